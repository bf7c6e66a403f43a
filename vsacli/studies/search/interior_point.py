"""A local minimum of a smooth cost under smooth inequalities, by a primal-dual interior-point method.

Newton's method on the perturbed conditions of Karush, Kuhn and Tucker, from one point that keeps all bounds
to the next, with a line search on the barrier function (Nocedal & Wright, "Numerical Optimization", 2nd ed.,
chapter 19; Forsgren & Gill, SIAM Journal on Optimization 8, 1998). The barrier falls as soon as
its problem is solved well enough (Waechter & Biegler, Mathematical Programming 106, 2006, equation 7).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from vsacli.base.arrays import FloatArray

FIRST_GAP, LAST_GAP = 0.1, 1e-7
"""Increase of the cost by all bounds together, at the first and at the last barrier; costs are about one."""

WARM_GAP = 1e-3
"""The same to begin with near a minimum: a wide barrier would drive the search away from it."""

NEARLY_SOLVED = 0.1
"""Share of the gap that a Newton step may still gain when the next barrier's turn has come."""

CENTRED = 10.0
"""Multiples of the barrier parameter to which products of bounds and multipliers come near it by then."""

SAFEGUARD = 1e5
"""Factor by which products may be off at all: Waechter's equation 16, with less freedom."""

FOUND = 100.0
"""Multiples of the last gap that may be left to gain, gap and Newton step together, at a minimum."""

PATIENCE, STALLED = 8, 1e-5
"""Steps that together lower the cost by less than this share of it, after which bounds are too curved."""

TO_BOUNDARY = 0.995
"""Share of the way to where a bound or a multiplier vanishes that a step may go."""

ARMIJO = 1e-4
"""Share of the decrease that the slope foretells with which a step is content."""

SHORTEST_STEP = 1e-10
"""Share of a step below which the search gives up: rounding hides the gain."""

MOST_ADDED = 1e6
"""Multiple of its diagonal that a matrix may get to be positive definite; steps go down the gradient then."""

MOST_STEPS = 200
"""Steps; twenty to forty are usual."""


class Point(Protocol):
    """Cost and bounds of unknowns, with their derivatives there; see `Problem`."""

    cost: float
    bounds: FloatArray
    gradient: FloatArray

    def changes(self, step: FloatArray) -> FloatArray:
        """Return the changes of the bounds with a step, to first order, (bounds,)."""

    def pull(self, weights: FloatArray) -> FloatArray:
        """Return the sum of the gradients of the bounds, each times its weight, (unknowns,)."""

    def newton_matrix(self, multipliers: FloatArray, stiffening: FloatArray, convex: bool) -> FloatArray:
        """Hessian of the cost plus multipliers times bounds, plus their gradients' squares times stiffening.

        If `convex`, with a positive semidefinite part in place of the first.
        """


class Problem(Protocol):
    """A cost, and bounds each of which shall not be positive."""

    def values(self, unknowns: FloatArray) -> tuple[float, FloatArray]:
        """Cost and bounds; not finite where they are not defined."""

    def at(self, unknowns: FloatArray) -> Point:
        """Return the same with derivatives."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """The end of a search, which keeps all bounds.

    Attributes:
        unknowns: (unknowns,).
        cost: there.
        found: whether the conditions for a minimum hold, as well as was asked for.
    """

    unknowns: FloatArray = field(repr=False)
    cost: float
    found: bool


def minimise(
    problem: Problem,
    start: FloatArray,
    gap: float = FIRST_GAP,
    last: float = LAST_GAP,
    stalled: float = STALLED,
    enough: Callable[[FloatArray], bool] = lambda _: False,
) -> Minimum:
    """Search from a start that keeps all bounds, none of them exactly.

    Args:
        problem: cost and bounds of the order of one.
        start: (unknowns,).
        gap: what bounds may raise the cost by at the first barrier; `WARM_GAP` near a minimum.
        last: the same at the last barrier.
        stalled: share of the cost that some steps together must gain for the search to go on.
        enough: whether unknowns are good enough to end the search.
    """
    point, unknowns = problem.at(start), start
    count = max(len(point.bounds), 1)
    multipliers = gap / count / -point.bounds
    costs = [point.cost]
    for _ in range(MOST_STEPS):
        newton = _Newton(point, multipliers)
        if newton.factor is None:
            return Minimum(unknowns, point.cost, found=False)
        step = newton.step(gap / count)
        while gap > last and step.gain <= NEARLY_SOLVED * gap and newton.centred(gap / count):
            gap = max(min(0.2 * gap, gap**1.5), last)
            step = newton.step(gap / count)
        solved = gap <= last and step.gain <= NEARLY_SOLVED * gap and newton.centred(gap / count)
        if solved or enough(unknowns) or _stalled(costs, stalled):
            break
        share = _line_search(problem, point, unknowns, step, gap / count)
        if share is None:
            break
        unknowns = unknowns + share * step.unknowns
        point = problem.at(unknowns)
        multipliers = _moved(multipliers, step.multipliers, gap / count / -point.bounds)
        costs.append(point.cost)
    return Minimum(unknowns, point.cost, gap + step.gain <= FOUND * last)


def _stalled(costs: Sequence[float], share: float) -> bool:
    """Return whether the last steps changed hardly anything."""
    recent = costs[-PATIENCE - 1 :]
    return len(recent) > PATIENCE and max(recent) - min(recent) < share * abs(recent[-1])


class _Step(NamedTuple):
    """A step of unknowns and multipliers; the former shall gain half of `gain` in the barrier function."""

    unknowns: FloatArray
    multipliers: FloatArray
    gain: float


class _Newton:
    """Newton's steps from a point, for any barrier parameter."""

    def __init__(self, point: Point, multipliers: FloatArray) -> None:
        self._point, self._multipliers, self._slack = point, multipliers, -point.bounds
        self._stiffening = multipliers / self._slack
        self.factor = _factor(point, multipliers, self._stiffening)

    def step(self, barrier: float) -> _Step:
        """Return the step of both, whose part for the unknowns the Cholesky factor solves."""
        from scipy.linalg import cho_solve

        assert self.factor is not None
        right = -(self._point.gradient + self._point.pull(barrier / self._slack))
        unknowns = cho_solve(self.factor, right)
        multipliers = (
            barrier / self._slack - self._multipliers + self._stiffening * self._point.changes(unknowns)
        )
        return _Step(unknowns, multipliers, float(right @ unknowns))

    def centred(self, barrier: float) -> bool:
        """Return whether products of bounds and multipliers are near the barrier parameter."""
        off = np.abs(self._slack * self._multipliers - barrier)
        return bool(off.max(initial=0.0) <= CENTRED * barrier)


def _factor(point: Point, multipliers: FloatArray, stiffening: FloatArray) -> tuple[FloatArray, bool] | None:
    """Return the factor of Newton's matrix if positive definite, else of a convex one with a small addition.

    None if that is not possible: numbers overflow, or nothing depends on some unknown.
    """
    from scipy.linalg import LinAlgError, cho_factor

    matrix, added = point.newton_matrix(multipliers, stiffening, convex=False), 0.0
    while added <= MOST_ADDED and np.isfinite(matrix).all():
        try:
            return cho_factor(matrix + added * np.diag(np.abs(np.diag(matrix))), lower=True)
        except LinAlgError:
            if not added:
                matrix = point.newton_matrix(multipliers, stiffening, convex=True)
            added = max(10 * added, 1e-12)
    return None


def _line_search(
    problem: Problem, point: Point, unknowns: FloatArray, step: _Step, barrier: float
) -> float | None:
    """Return the share of the step that lowers the barrier function and keeps the bounds.

    None if none does.
    """
    merit = point.cost - barrier * float(np.log(-point.bounds).sum())
    share = _share_to_boundary(-point.bounds, -point.changes(step.unknowns))
    rounding = 1e-14 * max(1.0, abs(merit))
    while share > SHORTEST_STEP:
        cost, bounds = problem.values(unknowns + share * step.unknowns)
        if np.isfinite(cost) and np.all(bounds < 0):
            there = cost - barrier * float(np.log(-bounds).sum())
            if there <= merit - ARMIJO * share * step.gain + rounding:
                return share
        share /= 2
    return None


def _moved(multipliers: FloatArray, step: FloatArray, central: FloatArray) -> FloatArray:
    """Multipliers after a step, positive and not too far from the central ones."""
    moved = multipliers + _share_to_boundary(multipliers, step) * step
    return np.clip(moved, central / SAFEGUARD, central * SAFEGUARD)


def _share_to_boundary(values: FloatArray, step: FloatArray) -> float:
    """Return the share of a step after which positive values are positive still."""
    falling = step < 0
    shares = -TO_BOUNDARY * values[falling] / step[falling]
    return float(min(1.0, shares.min(initial=1.0)))
