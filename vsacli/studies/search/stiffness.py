"""The stiffness profile of one joint that minimizes a cost along a fixed motion.

An interior-point method starts from several smooth profiles inside the attainable range, with bounds at some
instants. Starts that lead to a higher cost are discarded; the best is refined with finer splines, as long as
these lower the cost, until it keeps the bounds at all instants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.robot.joint import Joint
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError, Range, checked_range
from vsacli.studies.search.criteria import ROUGH_GAP, Criterion, Scale, rough_minima, smoothed_minimum
from vsacli.studies.search.fixed_motion import (
    CLEARANCE,
    FixedMotion,
    best_of_constants,
    nearest_profile,
    targets,
)
from vsacli.studies.search.interior_point import WARM_GAP, Minimum
from vsacli.studies.search.loads import Load
from vsacli.studies.search.separable import Group, SeparableProblem, interior, missed_instants
from vsacli.studies.search.splines import SplineSpace

INSTANTS_PER_PIECE = 8
"""Instants per piece of the spline at which the cost is integrated and bounds are kept."""

FIRST_PIECES = 12
"""Pieces of the splines for the several starts."""

MOST_PIECES = 96
"""Largest number of pieces after repeated halving."""

WORTH_HALVING = 1e-3
"""Relative decrease of the cost by halving the pieces above which they are halved again."""

SAME_COST = 1e-4
"""Relative difference of costs up to which two starts reached the same optimum."""

CLOSE_COST = 1e-2
"""Relative difference of costs with bounds at some instants up to which all bounds may change the order."""

MOST_ROUNDS = 12
"""Limit on rounds that add instants of violated bounds; one or two are usual, seven were needed once."""

SAME_LEVEL = 1e-5
"""Share of a level by which values may exceed it at some instants: a tenth of `SAME_COST`."""

STIFFEST = 100.0
"""Largest constant that is tried, as a multiple of the smallest admissible one."""

FIRST_LEVEL = 1.05
"""Initial level, as a multiple of the largest value that it bounds."""

ACTIVE = 1e-3
"""Relative distance from a bound below which it is active."""


@dataclass(frozen=True, eq=False)
class OptimizedStiffness:
    """An optimized stiffness over the instants of a load.

    Attributes:
        rows: stiffness with its first two derivatives at the instants of the load, (3, instants),
            N m/rad (N/m) per s^k.
        steps: indices of the instants that are samples of the trajectory.
        found: whether the conditions for a local optimum hold.
        starts: number of starts of the search.
        agreeing: number of starts that reached this optimum.
        bounding: share of the time during which each bound is active, by name of the bound.
    """

    rows: FloatArray = field(repr=False)
    steps: IndexArray | slice = field(repr=False)
    found: bool
    starts: int
    agreeing: int
    bounding: dict[str, float]


Spaces = Callable[[tuple[float, float], int, FloatArray], SplineSpace]
"""Function (span, number of pieces, times at which pieces may begin and end) that returns the splines."""


class _Attempt(NamedTuple):
    """A minimum among the splines of a space, the instants at which its bounds were kept, and its start."""

    space: SplineSpace
    minimum: Minimum
    instants: IndexArray
    start: FloatArray

    def reaches(self, other: _Attempt, share: float = SAME_COST) -> bool:
        """Return whether the cost is that of another attempt but for a share of it, or lower."""
        return self.minimum.cost <= other.minimum.cost + share * abs(other.minimum.cost)


class StiffnessSearch:
    """A search for the best stiffness profile of one joint.

    Args:
        acceptance: acceptance rule for every sample.
        joint: joint whose stiffness can be chosen.
        load: load of the joint. Pieces of splines begin and end at its samples, so that the spline is equal
            to the quintic by which a file with derivatives describes the time between two samples.
        criterion: objective.
        spaces: splines among which to search.
        seed: seed of the random starts.
        progress: function to call after each inner search, about ten in all.

    Raises:
        ImpossibleError: no stiffness keeps the margin and the limits of stiffness and deflection.
    """

    def __init__(
        self,
        acceptance: Acceptance,
        joint: Joint,
        load: Load,
        criterion: Criterion,
        spaces: Spaces,
        seed: int,
        progress: Callable[[], None],
    ) -> None:
        self._admissible = checked_range(acceptance, joint, load)
        if np.any(self._admissible.low > self._admissible.high):
            raise ImpossibleError(f"attainable range and limits leave {joint.name} no stiffness")
        self._joint, self._load, self._criterion = joint, load, criterion
        self._spaces, self._seed, self._progress = spaces, seed, progress
        self._span = float(load.time[0]), float(load.time[-1])
        self._steps = load.time[load.steps]
        self._bases: dict[SplineSpace, FloatArray] = {}
        self._most = min(MOST_PIECES, len(self._steps) - 1)
        self._whole = FixedMotion(joint, load, self._admissible, criterion, Scale(), acceptance.reserve)

    def best(self) -> OptimizedStiffness:
        """Return the best profile found from several starts.

        Raises:
            ImpossibleError: no profile was found.
        """
        pieces, starts = self._starts()
        space = self._space(pieces)
        self._scale_by(space, starts[0])
        roughly = self._roughly(space, evenly(len(self._load.time), INSTANTS_PER_PIECE * pieces + 1), starts)
        for rough in self._in_order(roughly):
            levels = self._refined(rough, pieces)
            best = self._completed_one_of(levels)
            if best is not None:
                if len(self._whole.smoothings) > 1:  # the smoothed cost of finer splines may mislead
                    kept = [best, *filter(self._keeps_all, levels[:-1])]
                    best = min(kept, key=self._unsmoothed_cost)
                agreeing = sum(each.reaches(rough) and rough.reaches(each) for each in roughly)
                return self._profile(best, len(starts), agreeing)
        raise ImpossibleError(
            f"no profile that was tried keeps every limit of the motors of {self._joint.name}"
        )

    def best_constant(self) -> OptimizedStiffness | None:
        """Return the best constant as a profile; None if no constant keeps all bounds."""
        space, stiffness = SplineSpace.constant(self._span), self._whole.stiffness
        low = float(self._admissible.low.max()) + CLEARANCE * stiffness
        high = min(float(self._admissible.high.min()) - CLEARANCE * stiffness, STIFFEST * low)
        if low >= high:
            return None
        self._scale_by(space, np.array([low]))
        every = self._group(space, np.arange(len(self._load.time)))
        instants = evenly(len(self._load.time), INSTANTS_PER_PIECE * FIRST_PIECES + 1)
        for _ in range(MOST_ROUNDS):
            found = best_of_constants(self._whole, low, high, instants)
            self._progress()
            if found is None:
                return None
            constant, cost = found
            unknowns = np.array([constant, cost / self._whole.scale.cost])[: 1 + self._criterion.levels]
            missed = np.setdiff1d(self._missed(every, unknowns), instants)
            if not missed.size:
                minimum = Minimum(unknowns, cost / self._whole.scale.cost, found=True)
                return self._profile(_Attempt(space, minimum, instants, unknowns[:1]), 1, 1)
            instants = np.union1d(instants, missed)
        return None

    def _roughly(
        self, space: SplineSpace, instants: IndexArray, starts: Sequence[FloatArray]
    ) -> list[_Attempt]:
        """Return the minima that starts lead to if bounds are kept at some instants only, best first."""
        every = self._group(space, np.arange(len(self._load.time)))
        problem = SeparableProblem([self._group(space, instants)])
        begun: list[tuple[FloatArray, FloatArray]] = []
        for start in starts:
            inside = self._with_level(every, start)
            unknowns = interior(problem, inside, inside)
            if unknowns is not None:
                begun.append((start, unknowns))
        found = rough_minima(problem, [unknowns for _, unknowns in begun], [self._whole])
        self._progress()
        attempts = [
            _Attempt(space, minimum, instants, start)
            for (start, _), minimum in zip(begun, found, strict=True)
        ]
        return sorted(attempts, key=lambda each: each.minimum.cost)

    def _keeps_all(self, attempt: _Attempt) -> bool:
        """Return whether an attempt keeps all bounds at all instants."""
        every = self._group(attempt.space, np.arange(len(self._load.time)))
        return not self._missed(every, attempt.minimum.unknowns).size

    def _unsmoothed_cost(self, attempt: _Attempt) -> float:
        """Return the cost over all instants without smoothing."""
        rows = self._basis(attempt.space) @ attempt.minimum.unknowns[: attempt.space.size]
        driven = self._whole.driven(rows, np.arange(len(self._load.time)))
        return self._criterion.of(self._joint, driven, self._load.time)

    def _in_order(self, roughly: Sequence[_Attempt]) -> Iterator[_Attempt]:
        """Yield different minima that keep bounds at some instants, the best with all bounds first.

        Bounds at further instants only raise a cost: a start that is worse without them is not completed.
        """
        different: list[_Attempt] = []
        for rough in roughly:
            if not any(rough.reaches(other) for other in different):
                different.append(rough)
        close = [each for each in different if each.reaches(different[0], CLOSE_COST)]
        if len(close) > 1:
            costs = [self._cost_with_all_bounds(each) for each in close]
            close = [close[index] for index in np.argsort(costs, kind="stable")]
        yield from close
        yield from different[len(close) :]

    def _cost_with_all_bounds(self, rough: _Attempt) -> float:
        found = self._completed(rough)
        return np.inf if found is None else found.minimum.cost

    def _space(self, pieces: int) -> SplineSpace:
        return self._spaces(self._span, pieces, self._steps)

    def _starts(self) -> tuple[int, list[FloatArray]]:
        """Return the smallest number of pieces with admissible splines, and such splines as starts."""
        time, coarsest = self._load.time, min(FIRST_PIECES, self._most)
        chosen = evenly(len(time), INSTANTS_PER_PIECE * MOST_PIECES)
        admissible = Range(*(row[chosen] for row in self._admissible))
        asked = self._load.command.commanded[STIFFNESS.key]
        wanted = [target[chosen] for target in targets(asked, self._admissible, time, self._seed)]
        for pieces in self._finer_than(coarsest // 2):
            space = self._space(pieces)
            basis = self._basis(space)[0, chosen]
            found = [nearest_profile(basis, time[chosen], target, admissible) for target in wanted]
            if starts := [amounts for amounts in found if amounts is not None]:
                return pieces, starts
        raise ImpossibleError(
            f"what {self._joint.name} may have is too narrow, or changes too fast, for a smooth profile"
        )

    def _basis(self, space: SplineSpace) -> FloatArray:
        """Return the shapes with two derivatives at all instants, (3, instants, shapes).

        They are kept: without that, the stiffness of least torque of a 3R takes 1.2 times as long.
        """
        if space not in self._bases:
            self._bases[space] = space.basis(self._load.time, STIFFNESS.orders)
        return self._bases[space]

    def _fitted(self, space: SplineSpace, values: FloatArray) -> FloatArray:
        """Return the coefficients of the spline nearest to values at all instants, (shapes,)."""
        return np.asarray(np.linalg.lstsq(self._basis(space)[0], values, rcond=None)[0])

    def _finer_than(self, pieces: int) -> Iterator[int]:
        """Yield numbers of pieces, each twice the previous one, up to the largest allowed."""
        while pieces < self._most:
            pieces = min(max(2 * pieces, 1), self._most)
            yield pieces

    def _scale_by(self, space: SplineSpace, amounts: FloatArray) -> None:
        """Scale the cost by the cost of a profile."""
        every = np.arange(len(self._load.time))
        driven = self._whole.driven(self._basis(space) @ amounts, every)
        size = self._criterion.size(self._joint, driven, self._load.time)
        self._whole.scale = Scale(size, self._span[1] - self._span[0], self._whole.smoothings[0])

    def _completed(self, attempt: _Attempt, *, accurate: bool = False) -> _Attempt | None:
        """Return an attempt that keeps all bounds at all instants, or None.

        Args:
            attempt: minimum with bounds at some instants, to which those where it violates bounds are added.
            accurate: whether the minimum is searched to the last barrier.
        """
        space, found, instants, start = attempt
        every = self._group(space, np.arange(len(self._load.time)))
        inside = self._with_level(every, start)
        searched = not accurate
        for _ in range(MOST_ROUNDS):
            missed, unknowns, gap = self._missed(every, found.unknowns), found.unknowns, ROUGH_GAP
            if searched and not missed.size:
                return _Attempt(space, found, instants, start)
            if missed.size:
                instants, gap = np.union1d(instants, missed), WARM_GAP
                unknowns = self._with_level(every, unknowns[: space.size])
            problem = SeparableProblem([self._group(space, instants)])
            begun = interior(problem, unknowns, inside) if missed.size else unknowns
            if begun is None:
                return None
            if accurate:
                found = smoothed_minimum(problem, begun, gap, [self._whole])
            else:
                (found,) = rough_minima(problem, [begun], [self._whole], gap)
            searched = True
            self._progress()
        return None

    def _completed_one_of(self, attempts: Sequence[_Attempt]) -> _Attempt | None:
        """Return the last attempt that keeps all bounds once they count, searched to the last barrier."""
        for attempt in reversed(attempts):
            rough = self._completed(attempt)
            if rough is not None:
                found = self._completed(rough, accurate=True)
                if found is None or (
                    rough.minimum.found and not found.minimum.found and rough.reaches(found)
                ):
                    return rough
                return found
        return None

    def _group(self, space: SplineSpace, instants: IndexArray) -> Group:
        """Return cost and bounds at some instants as a group of the separable problem."""
        time = self._load.time[instants]
        basis, levels = self._basis(space)[:, instants], self._criterion.levels
        if levels:
            of_levels = np.zeros((levels, *basis.shape[1:]))
            alone = np.zeros((len(basis) + levels, len(time), levels))
            alone[len(basis) :] = np.eye(levels)[:, None]
            basis = np.concatenate([np.concatenate([basis, of_levels]), alone], axis=2)
        natural = self._whole.stiffness / (space.piece ** np.arange(STIFFNESS.orders))
        low, high = (row[instants] for row in self._admissible)
        further = np.ones((self._whole.further_bounds, len(time)), dtype=bool)
        return Group(
            functions=self._whole,
            instants=instants,
            basis=basis,
            unknowns=np.arange(basis.shape[2]),
            weights=self._criterion.weights(time),
            there=np.concatenate([np.isfinite([low, high]), further]),
            scales=np.append(natural, np.ones(levels)),
        )

    def _with_level(self, every: Group, start: FloatArray) -> FloatArray:
        """Return a start with a level appended that bounds its values, if the cost is a level."""
        if not self._criterion.levels:
            return start
        driven = self._whole.driven((every.basis[:-1, :, :-1] @ start), every.instants)
        level = self._criterion.of(self._joint, driven, self._load.time) / self._whole.scale.cost
        return np.append(start, FIRST_LEVEL * level)

    def _missed(self, every: Group, unknowns: FloatArray) -> IndexArray:
        """Return the instants to add because bounds are violated there."""
        missed = every.bounds(every.rows(unknowns)) - CLEARANCE
        missed[len(self._whole.bound_names) :] -= SAME_LEVEL
        return missed_instants(missed)

    def _refined(self, coarse: _Attempt, pieces: int) -> list[_Attempt]:
        """Return the attempt, and those with finer pieces as long as these lower the cost.

        Bounds are kept at some instants, among them those at which the coarser splines violate them.
        """
        time, found = self._load.time, [coarse]
        inside = self._basis(coarse.space)[0] @ coarse.start
        for finer_pieces in self._finer_than(pieces):
            best, space = found[-1], self._space(finer_pieces)
            every = self._group(best.space, np.arange(len(time)))
            needed = np.union1d(best.instants, self._missed(every, best.minimum.unknowns))
            instants = np.union1d(evenly(len(time), INSTANTS_PER_PIECE * finer_pieces + 1), needed)
            finer = self._near(space, instants, best, self._fitted(space, inside))
            # of equal costs, that at more instants is the more accurate one
            if finer is None or not finer.reaches(best, WORTH_HALVING):
                break
            found.append(finer)
            gained = best.minimum.cost - finer.minimum.cost
            if gained + ROUGH_GAP <= WORTH_HALVING * abs(finer.minimum.cost):
                break
        return found

    def _near(
        self, space: SplineSpace, instants: IndexArray, coarse: _Attempt, start: FloatArray
    ) -> _Attempt | None:
        """Return a minimum among finer splines near one among coarser splines, or None."""
        every = self._group(space, np.arange(len(self._load.time)))
        problem = SeparableProblem([self._group(space, instants)])
        profile = self._basis(coarse.space)[0] @ coarse.minimum.unknowns[: coarse.space.size]
        near = self._with_level(every, self._fitted(space, profile))
        begun = interior(problem, near, self._with_level(every, start))
        if begun is None:
            return None
        (found,) = rough_minima(problem, [begun], [self._whole], WARM_GAP)
        self._progress()
        return _Attempt(space, found, instants, start)

    def _profile(self, attempt: _Attempt, starts: int, agreeing: int) -> OptimizedStiffness:
        amounts = attempt.minimum.unknowns[: attempt.space.size]
        rows = self._basis(attempt.space) @ amounts
        return OptimizedStiffness(
            rows=rows,
            steps=self._load.steps,
            found=attempt.minimum.found,
            starts=starts,
            agreeing=agreeing,
            bounding=self._bounding(rows),
        )

    def _bounding(self, rows: FloatArray) -> dict[str, float]:
        """Return the share of the time during which each bound is active, by name of the bound."""
        every = np.arange(len(self._load.time))
        _, bounds = self._whole((*rows, *[0.0 * rows[0]] * self._criterion.levels), every)
        shares = [float(np.mean(bound > -ACTIVE)) for bound in bounds]
        return {name: share for name, share in zip(self._whole.bound_names, shares, strict=False) if share}
