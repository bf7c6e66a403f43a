"""A local minimum of a smooth cost under smooth inequalities, by a primal-dual interior-point method.

Newton's method solves the perturbed Karush-Kuhn-Tucker conditions; every iterate is strictly inside all
bounds, with a line search on the barrier function (Nocedal & Wright, "Numerical Optimization", 2nd ed.,
chapter 19; Forsgren & Gill, SIAM Journal on Optimization 8, 1998). The barrier parameter is reduced once its
problem is solved well enough (Waechter & Biegler, Mathematical Programming 106, 2006, equation 7).
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray

FIRST_GAP, LAST_GAP = 0.1, 1e-7
"""Increase of the cost by all bounds together at the first and at the last barrier; costs are about 1."""

WARM_GAP = 1e-3
"""First gap of a search that starts near a minimum: a larger barrier would drive it away."""

NEARLY_SOLVED = 0.1
"""Share of the gap below which the gain of a Newton step ends a barrier problem."""

CENTRALITY_BOUND = 10.0
"""Largest deviation of slack times multiplier from the barrier parameter then, as a multiple of it."""

MAX_MULTIPLIER_RATIO = 1e5
"""Largest ratio of a multiplier to its central value: equation 16 of Waechter & Biegler, but tighter."""

MINIMUM_TOLERANCE = 100.0
"""Remaining gain at a minimum, gap plus Newton step, as a multiple of the last gap."""

PATIENCE, STALLED = 8, 1e-5
"""Number of steps, and the relative change of the cost within them below which the search has stalled."""

TO_BOUNDARY = 0.995
"""Share of the way to a zero of a slack or a multiplier that a step may cover."""

ARMIJO = 1e-4
"""Required share of the decrease that the slope predicts, in the line search."""

MIN_STEP_SHARE = 1e-10
"""Share of a step below which the line search gives up, since rounding hides the gain."""

MAX_DIAGONAL_SHARE = 1e6
"""Largest multiple of its diagonal added to a matrix to make it definite; it is gradient descent by then."""

MAX_STEPS = 200
"""Limit on steps; twenty to forty are usual."""


class Point(Protocol):
    """Cost and bounds at given unknowns, with their derivatives; see `Problem`."""

    cost: float
    bounds: FloatArray
    gradient: FloatArray

    def changes(self, step: FloatArray) -> FloatArray:
        """Return the first-order changes of the bounds with a step, (bounds,)."""

    def pull(self, weights: FloatArray) -> FloatArray:
        """Return the weighted sum of the gradients of the bounds, (unknowns,)."""

    def newton_matrix(self, multipliers: FloatArray, stiffening: FloatArray, convex: bool) -> FloatArray:
        """Return the Hessian of the Lagrangian plus the sum of stiffening * g g^T over gradients g of bounds.

        If `convex`, the Hessian is replaced by a positive semidefinite part of it.
        """


class Problem(Protocol):
    """A cost, and bounds that must not be positive, at several places at once."""

    def costs_and_bounds(self, unknowns: Sequence[FloatArray]) -> list[tuple[float, FloatArray]]:
        """Return cost and bounds for each array of unknowns; they are not finite where they are undefined."""

    def at(self, unknowns: Sequence[FloatArray]) -> Sequence[Point]:
        """Return cost and bounds with derivatives for each array of unknowns."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """The end of a search, strictly inside all bounds.

    Attributes:
        unknowns: unknowns at the end, (unknowns,).
        cost: cost at the end.
        found: whether the conditions for a minimum hold to the requested accuracy.
    """

    unknowns: FloatArray = field(repr=False)
    cost: float
    found: bool


def minimize(
    problem: Problem,
    start: FloatArray,
    gap: float = FIRST_GAP,
    last: float = LAST_GAP,
    stalled: float = STALLED,
    enough: Callable[[FloatArray], bool] = lambda _: False,
) -> Minimum:
    """Search for a minimum from a start strictly inside all bounds.

    Args:
        problem: problem with cost and bounds of the order of one.
        start: initial unknowns, (unknowns,).
        gap: increase of the cost by the bounds at the first barrier; `WARM_GAP` near a minimum.
        last: increase of the cost by the bounds at the last barrier.
        stalled: relative change of the cost within `PATIENCE` steps below which the search ends.
        enough: test of unknowns that ends the search early.
    """
    return _run_searches(problem, [_search_from(start, gap, last, stalled, enough)])[0]


def minimize_all(
    problem: Problem,
    starts: Sequence[FloatArray],
    gap: float = FIRST_GAP,
    last: float = LAST_GAP,
    stalled: float = STALLED,
) -> list[Minimum]:
    """Search for a minimum from each of several starts; see `minimize`.

    The searches take their steps together: evaluating a problem at several places costs little more than at
    one. One by one, the stiffness of least torque of a 3R takes 1.3 times as long. No search depends on the
    others.
    """
    return _run_searches(problem, [_search_from(start, gap, last, stalled) for start in starts])


class _EvaluationRequest(NamedTuple):
    """Unknowns at which a search needs the problem, and whether with derivatives."""

    unknowns: FloatArray
    derivatives: bool


_Search = Generator[_EvaluationRequest, Any, Minimum]
"""A search, which receives a `Point`, or cost and bounds, for each `_EvaluationRequest`."""


def _run_searches(problem: Problem, searches: Sequence[_Search]) -> list[Minimum]:
    """Run searches, each round of which needs one evaluation of the problem."""
    minima: dict[int, Minimum] = {}
    requests = {index: next(search) for index, search in enumerate(searches)}
    while requests:
        # derivatives last, so that as many searches as possible need them at the same time
        derivatives = all(request.derivatives for request in requests.values())
        search_indices = [index for index, request in requests.items() if request.derivatives == derivatives]
        unknowns = [requests[index].unknowns for index in search_indices]
        answers: Sequence[Any] = problem.at(unknowns) if derivatives else problem.costs_and_bounds(unknowns)
        for index, answer in zip(search_indices, answers, strict=True):
            try:
                requests[index] = searches[index].send(answer)
            except StopIteration as end:
                minima[index] = end.value
                del requests[index]
    return [minima[index] for index in range(len(searches))]


def _search_from(
    start: FloatArray,
    gap: float,
    last_gap: float,
    stalled: float,
    enough: Callable[[FloatArray], bool] = lambda _: False,
) -> _Search:
    """Search from one start; see `minimize`."""
    unknowns = start
    point = yield _EvaluationRequest(unknowns, derivatives=True)
    bound_count = max(len(point.bounds), 1)
    multipliers = gap / bound_count / -point.bounds
    costs = [point.cost]
    for _ in range(MAX_STEPS):
        newton = _Newton(point, multipliers)
        if newton.factor is None:
            return Minimum(unknowns, point.cost, found=False)
        step = newton.step(gap / bound_count)
        while gap > last_gap and step.gain <= NEARLY_SOLVED * gap and newton.centered(gap / bound_count):
            gap = max(min(0.2 * gap, gap**1.5), last_gap)
            step = newton.step(gap / bound_count)
        solved = gap <= last_gap and step.gain <= NEARLY_SOLVED * gap and newton.centered(gap / bound_count)
        if solved or enough(unknowns) or _has_stalled(costs, stalled):
            break
        next_point = yield from _search_along_step(point, unknowns, step, gap / bound_count)
        if next_point is None:
            break
        unknowns, point = next_point
        multipliers = _next_multipliers(multipliers, step.multipliers, gap / bound_count / -point.bounds)
        costs.append(point.cost)
    return Minimum(unknowns, point.cost, gap + step.gain <= MINIMUM_TOLERANCE * last_gap)


def _has_stalled(costs: Sequence[float], share: float) -> bool:
    """Return whether the cost has hardly changed in the last `PATIENCE` steps."""
    recent = costs[-PATIENCE - 1 :]
    return len(recent) > PATIENCE and max(recent) - min(recent) < share * abs(recent[-1])


class _NewtonStep(NamedTuple):
    """A step of unknowns and multipliers; its predicted decrease of the barrier function is `gain`/2."""

    unknowns: FloatArray
    multipliers: FloatArray
    gain: float


class _Newton:
    """Newton steps from a point, for any barrier parameter."""

    def __init__(self, point: Point, multipliers: FloatArray) -> None:
        self._point, self._multipliers, self._slack = point, multipliers, -point.bounds
        self._stiffening = multipliers / self._slack
        self.factor = _newton_factor(point, multipliers, self._stiffening)

    def step(self, barrier: float) -> _NewtonStep:
        """Return the step; multipliers are eliminated, and the Cholesky factor solves for the unknowns."""
        assert self.factor is not None
        right_hand_side = -(self._point.gradient + self._point.pull(barrier / self._slack))
        unknowns = scipy.linalg.cho_solve(self.factor, right_hand_side)
        multipliers = (
            barrier / self._slack - self._multipliers + self._stiffening * self._point.changes(unknowns)
        )
        return _NewtonStep(unknowns, multipliers, float(right_hand_side @ unknowns))

    def centered(self, barrier: float) -> bool:
        """Return whether all products of slack and multiplier are near the barrier parameter."""
        deviation = np.abs(self._slack * self._multipliers - barrier)
        return bool(deviation.max(initial=0.0) <= CENTRALITY_BOUND * barrier)


def _newton_factor(
    point: Point, multipliers: FloatArray, stiffening: FloatArray
) -> tuple[FloatArray, bool] | None:
    """Return the Cholesky factor of Newton's matrix, or of a convex one plus a multiple of its diagonal.

    Return None if that fails, because values overflow or nothing depends on some unknown.
    """
    matrix, diagonal_share = point.newton_matrix(multipliers, stiffening, convex=False), 0.0
    while diagonal_share <= MAX_DIAGONAL_SHARE and np.isfinite(matrix).all():
        try:
            return scipy.linalg.cho_factor(
                matrix + diagonal_share * np.diag(np.abs(np.diag(matrix))), lower=True
            )
        except scipy.linalg.LinAlgError:
            if not diagonal_share:
                matrix = point.newton_matrix(multipliers, stiffening, convex=True)
            diagonal_share = max(10 * diagonal_share, 1e-12)
    return None


def _search_along_step(
    point: Point, unknowns: FloatArray, step: _NewtonStep, barrier: float
) -> Generator[_EvaluationRequest, Any, tuple[FloatArray, Point] | None]:
    """Return the unknowns after a share of the step that lowers the barrier function inside the bounds.

    Args:
        point: cost and bounds before the step.
        unknowns: unknowns before the step.
        step: Newton step.
        barrier: barrier parameter.

    Returns:
        The unknowns, and cost and bounds there; None if no share lowers it.
    """
    merit = point.cost - barrier * float(np.log(-point.bounds).sum())
    rounding = 1e-14 * max(1.0, abs(merit))

    def lower(cost: float, bounds: FloatArray, share: float) -> bool:
        if not (np.isfinite(cost) and np.all(bounds < 0)):
            return False
        trial_merit = cost - barrier * float(np.log(-bounds).sum())
        return trial_merit <= merit - ARMIJO * share * step.gain + rounding

    share = _share_to_boundary(-point.bounds, -point.changes(step.unknowns))
    while share > MIN_STEP_SHARE:
        next_unknowns = unknowns + share * step.unknowns
        cost, bounds = yield _EvaluationRequest(next_unknowns, derivatives=False)
        if lower(cost, bounds, share):
            next_point = yield _EvaluationRequest(next_unknowns, derivatives=True)
            return next_unknowns, next_point
        share /= 2
    return None


def _next_multipliers(
    multipliers: FloatArray, step: FloatArray, central_multipliers: FloatArray
) -> FloatArray:
    """Return the multipliers after a step, positive and within `MAX_MULTIPLIER_RATIO` of the central ones."""
    next_multipliers = multipliers + _share_to_boundary(multipliers, step) * step
    return np.clip(
        next_multipliers,
        central_multipliers / MAX_MULTIPLIER_RATIO,
        central_multipliers * MAX_MULTIPLIER_RATIO,
    )


def _share_to_boundary(values: FloatArray, step: FloatArray) -> float:
    """Return the share of a step, at most 1, after which positive values remain positive."""
    falling = step < 0
    shares = -TO_BOUNDARY * values[falling] / step[falling]
    return float(min(1.0, shares.min(initial=1.0)))
