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

LEAST_SHARE, LEAST_SPREAD = 1e-6, 1e-9
"""What a spread is measured against if it is smaller: a share of the largest deflection; rad (m)."""

TOLERATED, GAIN = 1e-9, 4.0
"""Below, halving twice must lower that share by this factor to be worth another one: else it is noise of the
trajectory itself, whose knots may lie denser than the cells."""

HALVINGS = 20
"""To where a motion cannot go on, within a millionth of a first cell."""

LAYER = 4.0
"""Where the demand sets in anew, something dies away that need not show in a cell of more than so many time
constants: its polynomial passes it over."""

FAST = 100.0
"""In cells of more time constants, the polynomial of the spread knows the rates better than the equation.

By that rounding makes them wrong by eps T/d, by the polynomial by some eps spread STAGES^2 2/duration, which
is less beyond 288 time constants; for the next derivative beyond 170.
"""

NEWTON_STEPS = 20
"""Mostly five are taken."""

CONVERGED = 1e-12
"""Step, relative to the spread, after which the next one, which is quadratic in it, is rounding.

Where the load passes zero, so does the spread, and is rounding itself: there, relative to that of the peak
torque.
"""

LOST, SINGULAR = (
    "its springs cannot have the stiffness at the deflection that the damper has let through",
    "the stiffness does not determine the second motor any more",
)
"""Why it cannot go on."""


class Marched(NamedTuple):
    """The motion inside as functions of time.

    Attributes:
        phi: deflections, (2, samples), up to where they go; None if they go nowhere.
        rates: w and its derivative, (2, samples), likewise.
        end: up to which time, s.
        reason: why not further; None at the end of the trajectory.
    """

    phi: Piecewise | None
    rates: Piecewise | None
    end: float
    reason: str | None


class _Solution(NamedTuple):
    """What was found in a cell, at its start and nodes, or at its nodes alone.

    Attributes:
        phi: deflections, (2, 1 + stages).
        rates: w and its derivative by the equation, (2, stages).
        torque: the largest that is asked of the joint.
        damping: the largest.
        constants: the time constants that the cell lasts.
    """

    phi: FloatArray
    rates: FloatArray
    torque: float
    damping: float
    constants: float


class _Cell(NamedTuple):
    """A cell that is still to be solved.

    Attributes:
        left, right: its ends, s.
        new: whether the demand sets in anew where it begins.
        shares: of the last coefficients in the cells that it is a half and a quarter of, the latter first.
        halved: how often it was halved.
    """

    left: float
    right: float
    new: bool = True
    shares: tuple[float, float] = (np.inf, np.inf)
    halved: int = 0

    def halves(self, share: float) -> tuple[_Cell, _Cell]:
        """Left and right."""
        middle = (self.left + self.right) / 2
        return (
            _Cell(self.left, middle, self.new, (self.shares[1], share), self.halved + 1),
            _Cell(middle, self.right, False, (self.shares[1], share), self.halved + 1),
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
        ended, solved = [float(ends[0])], list[tuple[FloatArray, FloatArray]]()
        peaks = _Peaks(self._springs, self._demand(ends), phi)
        todo = [_Cell(left, right) for left, right in pairwise(ends.tolist())][::-1]
        while todo:
            cell = todo.pop()
            found = self._solved(cell, phi, peaks.torque)
            if isinstance(found, str):
                share, unresolved = np.inf, True
            else:
                fitted = self._fitted(cell, found)
                share = peaks.share(*fitted, found)
                settling = cell.new and found.constants > LAYER
                falling = share < cell.shares[0] / GAIN
                unresolved = share > RESOLVED and (share > TOLERATED or falling or settling)
            if unresolved and cell.halved < HALVINGS:
                todo += cell.halves(share)[::-1]
            elif isinstance(found, str):
                return Marched(*_joined(ended, solved), cell.left, found)
            else:
                phi = found.phi[:, -1:]
                solved.append(fitted)
                ended.append(cell.right)
        return Marched(*_joined(ended, solved), ended[-1], None)

    def _fitted(self, cell: _Cell, found: _Solution) -> tuple[FloatArray, FloatArray]:
        """Coefficients of deflections and rates; the latter by the equation, in fast cells derivatives."""
        from numpy.polynomial import chebyshev

        phi = self._rule.coefficients(found.phi)
        if found.constants <= FAST:
            return phi, self._rule.coefficients_of_rates(found.rates)
        half = (cell.right - cell.left) / 2
        first = chebyshev.chebder(self._springs.spread(phi)) / half
        second = np.append(chebyshev.chebder(first) / half, 0.0)
        return phi, np.stack((first, second))

    def _solved(self, cell: _Cell, start: FloatArray, peak: float) -> _Solution | str:
        """Deflections in a cell from those at its start, by Newton's method; or why there are none.

        Args:
            cell: where.
            start: deflections (2, 1).
            peak: torque so far, N m (N).
        """
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
                fastest = np.max(np.abs(springs.slope(phi, command.q)) / damping)
                return _Solution(
                    np.hstack((start, phi)),
                    np.stack(springs.driven(phi, command)),
                    float(np.max(np.abs(command.tau_e))),
                    float(np.max(damping)),
                    (cell.right - cell.left) * float(fastest),
                )
            rate = slopes[:, 0] * before + slopes[:, 1:] @ spread
            missing = command.tau_e - springs.torque(phi, command.q) - damping * rate
            slope = springs.slope(phi, command.q)
            matrix = damping[:, None] * slopes[:, 1:] + np.diag(slope)
            step = np.asarray(np.linalg.solve(matrix, missing), dtype=np.float64)
            spread = spread + step
            converged = _largest(step) <= CONVERGED * max(_largest(spread), peak / _largest(slope))
        return LOST


class _Peaks:
    """The largest numbers so far, which the last coefficients are measured by.

    A motion from rest begins with torques that are nothing but rounding, so these are looked at beforehand.

    Args:
        springs: of the joint.
        demand: at the ends of the first cells.
        start: deflections at the first of them.

    Attributes:
        torque: N m (N).
    """

    def __init__(self, springs: DampedSprings, demand: Command, start: FloatArray) -> None:
        self._springs = springs
        self._slope = _largest(springs.slope(start, demand.q[:1]))
        self.torque = _largest(demand.tau_e)
        self._phi, self._spread = 0.0, LEAST_SPREAD

    def share(self, phi: FloatArray, rates: FloatArray, found: _Solution) -> float:
        """Of the last coefficients of deflections, spread and torque of the damper, in its peak so far."""
        spread = self._springs.spread(phi)
        self._phi = max(self._phi, float(np.nanmax(np.abs(phi))))
        self._spread = max(self._spread, _largest(spread), LEAST_SHARE * self._phi)
        self.torque = max(self.torque, found.torque, self._slope * self._spread)
        of_phi = float(np.nanmax(np.abs(phi[:, -2:]))) / max(self._phi, LEAST_SPREAD)
        share = max(of_phi, _largest(spread[-2:]) / self._spread)
        if found.constants > FAST:
            return share
        return max(share, found.damping * _largest(rates[0, -2:]) / self.torque)


def _largest(values: FloatArray) -> float:
    return float(np.max(np.abs(values)))


def _joined(
    ended: list[float], solved: list[tuple[FloatArray, FloatArray]]
) -> tuple[Piecewise | None, Piecewise | None]:
    """Deflections and rates over all cells."""
    if not solved:
        return None, None
    phi, rates = (Piecewise(np.array(ended), np.stack(each)) for each in zip(*solved, strict=True))
    return phi, rates
