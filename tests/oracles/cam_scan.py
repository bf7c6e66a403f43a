"""A preloaded cam by brute force: the reachable stiffness from dense scans over the deflection.

A cam is its lift as a formula; derivatives come from sympy. At a given torque the scan walks from rest
outward: every deflection says which pretension it needs and which stiffness it gives.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import sympy

Array = npt.NDArray[np.float64]

NODES = np.concatenate((np.geomspace(1e-13, 0.01, 1200), np.linspace(0.01, 1, 5000)[1:]))
"""Shares of the way from rest to the end of the domain."""


class Reach(NamedTuple):
    """Reachable stiffness, NaN if the torque cannot be carried, and whether it ends where it turns around."""

    lower: float
    upper: float
    turns: bool


@dataclass(frozen=True)
class Cam:
    """A lift l with l(0) = l'(0) = 0.

    Attributes:
        lift: the formula, in sympy's functions.
        domain: deflections from rest for which it holds.
        k: N/m.
        pretension: smallest and largest, m.
    """

    lift: Callable[[Any], Any]
    domain: tuple[float, float]
    k: float
    pretension: tuple[float, float]

    @cached_property
    def _derivatives(self) -> Callable[..., Any]:
        phi = sympy.Symbol("phi", real=True)
        lift = sympy.sympify(self.lift(phi))
        wanted = [lift.diff(phi, order) for order in range(3)]
        if lift.is_polynomial():
            wanted = [sympy.horner(each) for each in wanted]
        return sympy.lambdify(phi, wanted, "numpy", cse=True)

    def springs(self, phi: Array, pretension: Array) -> tuple[Array, Array]:
        """Torque and stiffness."""
        l, l1, l2 = self._derivatives(phi)  # noqa: E741
        return self.k * l1 * (l + pretension), self.k * (l1 * l1 + l2 * (l + pretension))

    def along(self, phi: Array, tau_e: float | Array) -> tuple[Array, Array]:
        """Pretension and stiffness that a torque asks for at deflections."""
        l, l1, l2 = self._derivatives(phi)  # noqa: E741
        with np.errstate(all="ignore"):
            x = tau_e / (self.k * l1)
            return x - l, self.k * (l1 * l1 + l2 * x)

    def reach(self, tau_e: float) -> Reach:
        """The first monotone piece of the stiffness from rest outward, within the pretensions."""
        low, high = self.pretension
        end = self.domain[1] if tau_e > 0 else self.domain[0]
        phi = end * NODES
        for _ in range(5):  # ever finer where the piece begins, and where it ends
            pretension, stiffness = self.along(phi, tau_e)
            inside = pretension <= high
            first = int(inside.argmax())
            _, at_highest = self.springs(phi[: first + 1], np.full(first + 1, high))
            if not inside.any() or np.any(at_highest <= 0):  # beyond the first peak of the torque
                return Reach(np.nan, np.nan, turns=False)
            slope = np.sign(np.diff(stiffness[first:]))
            going = (slope == slope[0]) & (stiffness[first + 1 :] > 0) & (pretension[first + 1 :] >= low)
            last = first + (len(going) if going.all() else int(going.argmin()))
            cells = [phi[max(at - 2, 0) : at + 3] for at in (first, last)]
            finer = [np.linspace(cell[0], cell[-1], 200) for cell in cells]
            done = first, last, phi, pretension, stiffness
            phi = np.unique(np.concatenate((phi, *finer)) * np.sign(end)) * np.sign(end)
        first, last, phi, pretension, stiffness = done
        turns = bool(last + 1 < len(phi) and stiffness[last + 1] > 0 and pretension[last + 1] >= low)
        ends = sorted((float(stiffness[first]), float(stiffness[last])))
        return Reach(*ends, turns=turns)
