"""The spread of the springs parallel to one damper, integrated from cell to cell."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vsacli.actuators.damped_springs import DampedSprings
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray
from vsacli.base.signals import DAMPING
from vsacli.dynamics.internal_motion.collocation import Collocation, Piecewise

FIRST_CELLS = 8
"""Cells that a trajectory is divided into at first; those that a polynomial does not fit are halved."""

RESOLVED = 1e-14
"""Share of the largest deflection that the last coefficients of a polynomial may have: rounding."""

TOLERATED, GAIN = 1e-9, 4.0
"""Below, halving twice must lower that share by this factor to be worth another one: else it is noise of the
trajectory itself, whose knots may lie denser than the cells."""

HALVINGS = 20
"""To where a motion cannot go on, within a millionth of a first cell."""

NEWTON_STEPS = 20
"""Mostly five are taken."""

CONVERGED = 1e-12
"""Step, relative to the deflections, after which the next one, which is quadratic in it, is rounding."""

LOST, SINGULAR = (
    "its springs cannot have the stiffness at the deflection that the damper has let through",
    "the stiffness does not determine the second motor any more",
)
"""Why it cannot go on."""


class Marched(NamedTuple):
    """Deflections as a function of time, (2, samples).

    Attributes:
        phi: up to where they go; None if they go nowhere.
        end: up to which time, s.
        reason: why not further; None at the end of the trajectory.
    """

    phi: Piecewise | None
    end: float
    reason: str | None


class _Cell(NamedTuple):
    """A cell that is still to be solved.

    Attributes:
        left, right: its ends, s.
        shares: of the last coefficients in the cells that it is a half and a quarter of, the latter first.
        halved: how often it was halved.
    """

    left: float
    right: float
    shares: tuple[float, float] = (np.inf, np.inf)
    halved: int = 0

    def halves(self, share: float) -> tuple[_Cell, _Cell]:
        """Left and right."""
        middle = (self.left + self.right) / 2
        return (
            _Cell(self.left, middle, (self.shares[1], share), self.halved + 1),
            _Cell(middle, self.right, (self.shares[1], share), self.halved + 1),
        )


class March:
    """Solves d w = tau_l - T from deflections at the start on.

    Args:
        springs: of the joint.
        demand: what the joint is asked to do at times (samples,), s.
    """

    def __init__(self, springs: DampedSprings, demand: Callable[[FloatArray], Command]) -> None:
        self._springs, self._demand, self._rule = springs, demand, Collocation()

    def through(self, ends: FloatArray, phi: FloatArray) -> Marched:
        """The whole way, from deflections (2, 1); between the ends, s, the demand is smooth."""
        solved: list[FloatArray] = []
        reached, peak = [float(ends[0])], 0.0
        todo = [_Cell(left, right) for left, right in pairwise(ends.tolist())][::-1]
        while todo:
            cell = todo.pop()
            found = self._solved(cell, phi)
            coefficients = None if isinstance(found, str) else self._rule.coefficients(found)
            share = np.inf
            if coefficients is not None:
                sizes = np.abs(coefficients)
                peak = max(peak, float(np.nanmax(sizes)))
                share = float(np.nanmax(sizes[:, -2:])) / peak if peak else 0.0
            unresolved = share > RESOLVED and (share > TOLERATED or share < cell.shares[0] / GAIN)
            if unresolved and cell.halved < HALVINGS:
                todo += cell.halves(share)[::-1]
            elif coefficients is None:
                return Marched(_joined(reached, solved), cell.left, str(found))
            else:
                phi = np.asarray(found)[:, -1:]
                solved.append(coefficients)
                reached.append(cell.right)
        return Marched(_joined(reached, solved), reached[-1], None)

    def _solved(self, cell: _Cell, start: FloatArray) -> FloatArray | str:
        """Deflections at start and nodes of a cell, (2, 1 + stages), by Newton's method; or why not."""
        springs, command = self._springs, self._demand(self._rule.times(cell.left, cell.right))
        slopes, damping = self._rule.slopes(cell.left, cell.right), command.commanded[DAMPING.key]
        before, side = springs.spread(start), np.sign(springs.pivot(start, command.q[:1]))
        spread, phi = before + 0 * command.q, start + 0 * command.q
        converged = False
        for _ in range(NEWTON_STEPS):
            phi = springs.settled(spread, phi, command)
            if np.isnan(phi[0]).any() or not springs.within(phi).all():
                return LOST
            if (np.sign(springs.pivot(phi, command.q)) != side).any():
                return SINGULAR
            if converged:
                return np.hstack((start, phi))
            rate = slopes[:, 0] * before + slopes[:, 1:] @ spread
            missing = command.tau_e - springs.torque(phi, command.q) - damping * rate
            matrix = damping[:, None] * slopes[:, 1:] + np.diag(springs.slope(phi, command.q))
            step = np.linalg.solve(matrix, missing)
            spread = spread + step
            converged = bool(np.abs(step).max() <= CONVERGED * np.abs(spread).max())
        return LOST


def _joined(reached: list[float], solved: list[FloatArray]) -> Piecewise | None:
    return Piecewise(np.array(reached), np.stack(solved)) if solved else None
