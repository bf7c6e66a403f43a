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
    best_constant_stiffness,
    nearest_profile,
    targets,
)
from vsacli.studies.search.interior_point import WARM_GAP, Minimum
from vsacli.studies.search.loads import Load
from vsacli.studies.search.separable import Group, SeparableProblem, interior, violated_instants
from vsacli.studies.search.splines import SplineSpace

INSTANTS_PER_PIECE = 8
"""Instants per piece of the spline at which the cost is integrated and bounds are kept."""

FIRST_PIECES = 12
"""Pieces of the splines for the several starts."""

MAX_PIECES = 96
"""Largest number of pieces after repeated halving."""

MIN_COST_DECREASE = 1e-3
"""Relative decrease of the cost by halving the pieces above which they are halved again."""

COST_TOLERANCE = 1e-4
"""Relative difference of costs up to which two starts reached the same optimum."""

CLOSE_COST_TOLERANCE = 1e-2
"""Relative difference of costs with bounds at some instants up to which all bounds may change the order."""

MAX_ROUNDS = 12
"""Limit on rounds that add instants of violated bounds; one or two are usual, seven were needed once."""

LEVEL_TOLERANCE = 1e-5
"""Share of a level by which values may exceed it at some instants: a tenth of `COST_TOLERANCE`."""

MAX_CONSTANT_RATIO = 100.0
"""Largest constant that is tried, as a multiple of the smallest admissible one."""

FIRST_LEVEL = 1.05
"""Initial level, as a multiple of the largest value that it bounds."""

ACTIVE_TOLERANCE = 1e-3
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

    def reaches(self, other: _Attempt, share: float = COST_TOLERANCE) -> bool:
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
        self._sample_times = load.time[load.steps]
        self._bases: dict[SplineSpace, FloatArray] = {}
        self._max_pieces = min(MAX_PIECES, len(self._sample_times) - 1)
        self._motion = FixedMotion(joint, load, self._admissible, criterion, Scale(), acceptance.reserve)

    def best(self) -> OptimizedStiffness:
        """Return the best profile found from several starts.

        Raises:
            ImpossibleError: no profile was found.
        """
        pieces, starts = self._starts()
        space = self._space(pieces)
        self._set_cost_scale(space, starts[0])
        attempts = self._rough_attempts(
            space, evenly(len(self._load.time), INSTANTS_PER_PIECE * pieces + 1), starts
        )
        for attempt in self._ordered_attempts(attempts):
            refinements = self._refinements(attempt, pieces)
            best = self._finest_full_attempt(refinements)
            if best is not None:
                if len(self._motion.smoothings) > 1:  # the smoothed cost of finer splines may mislead
                    accepted_attempts = [best, *filter(self._keeps_all, refinements[:-1])]
                    best = min(accepted_attempts, key=self._unsmoothed_cost)
                agreeing = sum(each.reaches(attempt) and attempt.reaches(each) for each in attempts)
                return self._optimized_profile(best, len(starts), agreeing)
        raise ImpossibleError(
            f"no profile that was tried keeps every limit of the motors of {self._joint.name}"
        )

    def best_constant(self) -> OptimizedStiffness | None:
        """Return the best constant as a profile; None if no constant keeps all bounds."""
        space, stiffness = SplineSpace.constant(self._span), self._motion.stiffness
        min_constant = float(self._admissible.low.max()) + CLEARANCE * stiffness
        max_constant = min(
            float(self._admissible.high.min()) - CLEARANCE * stiffness, MAX_CONSTANT_RATIO * min_constant
        )
        if min_constant >= max_constant:
            return None
        self._set_cost_scale(space, np.array([min_constant]))
        full_group = self._group(space, np.arange(len(self._load.time)))
        instants = evenly(len(self._load.time), INSTANTS_PER_PIECE * FIRST_PIECES + 1)
        for _ in range(MAX_ROUNDS):
            found = best_constant_stiffness(self._motion, min_constant, max_constant, instants)
            self._progress()
            if found is None:
                return None
            constant, cost = found
            unknowns = np.array([constant, cost / self._motion.scale.cost])[: 1 + self._criterion.levels]
            violated_instants = np.setdiff1d(self._violated_instants(full_group, unknowns), instants)
            if not violated_instants.size:
                minimum = Minimum(unknowns, cost / self._motion.scale.cost, found=True)
                return self._optimized_profile(_Attempt(space, minimum, instants, unknowns[:1]), 1, 1)
            instants = np.union1d(instants, violated_instants)
        return None

    def _rough_attempts(
        self, space: SplineSpace, instants: IndexArray, starts: Sequence[FloatArray]
    ) -> list[_Attempt]:
        """Return the minima that starts lead to if bounds are kept at some instants only, best first."""
        full_group = self._group(space, np.arange(len(self._load.time)))
        problem = SeparableProblem([self._group(space, instants)])
        interior_starts: list[tuple[FloatArray, FloatArray]] = []
        for start in starts:
            interior_point = self._append_level(full_group, start)
            unknowns = interior(problem, interior_point, interior_point)
            if unknowns is not None:
                interior_starts.append((start, unknowns))
        minima = rough_minima(problem, [unknowns for _, unknowns in interior_starts], [self._motion])
        self._progress()
        attempts = [
            _Attempt(space, minimum, instants, start)
            for (start, _), minimum in zip(interior_starts, minima, strict=True)
        ]
        return sorted(attempts, key=lambda each: each.minimum.cost)

    def _keeps_all(self, attempt: _Attempt) -> bool:
        """Return whether an attempt keeps all bounds at all instants."""
        full_group = self._group(attempt.space, np.arange(len(self._load.time)))
        return not self._violated_instants(full_group, attempt.minimum.unknowns).size

    def _unsmoothed_cost(self, attempt: _Attempt) -> float:
        """Return the cost over all instants without smoothing."""
        rows = self._basis(attempt.space) @ attempt.minimum.unknowns[: attempt.space.size]
        drive_variables = self._motion.driven(rows, np.arange(len(self._load.time)))
        return self._criterion.of(self._joint, drive_variables, self._load.time)

    def _ordered_attempts(self, attempts: Sequence[_Attempt]) -> Iterator[_Attempt]:
        """Yield different minima that keep bounds at some instants, the best with all bounds first.

        Bounds at further instants only raise a cost: a start that is worse without them is not completed.
        """
        distinct_attempts: list[_Attempt] = []
        for attempt in attempts:
            if not any(attempt.reaches(other) for other in distinct_attempts):
                distinct_attempts.append(attempt)
        close_attempts = [
            each for each in distinct_attempts if each.reaches(distinct_attempts[0], CLOSE_COST_TOLERANCE)
        ]
        if len(close_attempts) > 1:
            costs = [self._cost_with_all_bounds(each) for each in close_attempts]
            close_attempts = [close_attempts[index] for index in np.argsort(costs, kind="stable")]
        yield from close_attempts
        yield from distinct_attempts[len(close_attempts) :]

    def _cost_with_all_bounds(self, attempt: _Attempt) -> float:
        full_attempt = self._full_attempt(attempt)
        return np.inf if full_attempt is None else full_attempt.minimum.cost

    def _space(self, pieces: int) -> SplineSpace:
        return self._spaces(self._span, pieces, self._sample_times)

    def _starts(self) -> tuple[int, list[FloatArray]]:
        """Return the smallest number of pieces with admissible splines, and such splines as starts."""
        time, max_first_pieces = self._load.time, min(FIRST_PIECES, self._max_pieces)
        instants = evenly(len(time), INSTANTS_PER_PIECE * MAX_PIECES)
        admissible = Range(*(row[instants] for row in self._admissible))
        commanded_stiffness = self._load.command.commanded[STIFFNESS.key]
        start_targets = [
            target[instants] for target in targets(commanded_stiffness, self._admissible, time, self._seed)
        ]
        for pieces in self._finer_piece_counts(max_first_pieces // 2):
            space = self._space(pieces)
            basis = self._basis(space)[0, instants]
            start_coefficients = [
                nearest_profile(basis, time[instants], target, admissible) for target in start_targets
            ]
            if starts := [coefficients for coefficients in start_coefficients if coefficients is not None]:
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

    def _fitted_coefficients(self, space: SplineSpace, values: FloatArray) -> FloatArray:
        """Return the coefficients of the spline nearest to values at all instants, (shapes,)."""
        return np.asarray(np.linalg.lstsq(self._basis(space)[0], values, rcond=None)[0])

    def _finer_piece_counts(self, pieces: int) -> Iterator[int]:
        """Yield numbers of pieces, each twice the previous one, up to the largest allowed."""
        while pieces < self._max_pieces:
            pieces = min(max(2 * pieces, 1), self._max_pieces)
            yield pieces

    def _set_cost_scale(self, space: SplineSpace, coefficients: FloatArray) -> None:
        """Scale the cost by the cost of a profile."""
        all_instants = np.arange(len(self._load.time))
        drive_variables = self._motion.driven(self._basis(space) @ coefficients, all_instants)
        cost = self._criterion.size(self._joint, drive_variables, self._load.time)
        self._motion.scale = Scale(cost, self._span[1] - self._span[0], self._motion.smoothings[0])

    def _full_attempt(self, attempt: _Attempt, *, accurate: bool = False) -> _Attempt | None:
        """Return an attempt that keeps all bounds at all instants, or None.

        Args:
            attempt: minimum with bounds at some instants, to which those where it violates bounds are added.
            accurate: whether the minimum is searched to the last barrier.
        """
        space, minimum, instants, start = attempt
        full_group = self._group(space, np.arange(len(self._load.time)))
        interior_point = self._append_level(full_group, start)
        is_minimized = not accurate
        for _ in range(MAX_ROUNDS):
            violated_instants, unknowns, gap = (
                self._violated_instants(full_group, minimum.unknowns),
                minimum.unknowns,
                ROUGH_GAP,
            )
            if is_minimized and not violated_instants.size:
                return _Attempt(space, minimum, instants, start)
            if violated_instants.size:
                instants, gap = np.union1d(instants, violated_instants), WARM_GAP
                unknowns = self._append_level(full_group, unknowns[: space.size])
            problem = SeparableProblem([self._group(space, instants)])
            interior_start = (
                interior(problem, unknowns, interior_point) if violated_instants.size else unknowns
            )
            if interior_start is None:
                return None
            if accurate:
                minimum = smoothed_minimum(problem, interior_start, gap, [self._motion])
            else:
                (minimum,) = rough_minima(problem, [interior_start], [self._motion], gap)
            is_minimized = True
            self._progress()
        return None

    def _finest_full_attempt(self, attempts: Sequence[_Attempt]) -> _Attempt | None:
        """Return the last attempt that keeps all bounds once they count, searched to the last barrier."""
        for attempt in reversed(attempts):
            full_attempt = self._full_attempt(attempt)
            if full_attempt is not None:
                accurate_attempt = self._full_attempt(full_attempt, accurate=True)
                if accurate_attempt is None or (
                    full_attempt.minimum.found
                    and not accurate_attempt.minimum.found
                    and full_attempt.reaches(accurate_attempt)
                ):
                    return full_attempt
                return accurate_attempt
        return None

    def _group(self, space: SplineSpace, instants: IndexArray) -> Group:
        """Return cost and bounds at some instants as a group of the separable problem."""
        time = self._load.time[instants]
        basis, levels = self._basis(space)[:, instants], self._criterion.levels
        if levels:
            level_rows = np.zeros((levels, *basis.shape[1:]))
            level_basis = np.zeros((len(basis) + levels, len(time), levels))
            level_basis[len(basis) :] = np.eye(levels)[:, None]
            basis = np.concatenate([np.concatenate([basis, level_rows]), level_basis], axis=2)
        row_scales = self._motion.stiffness / (space.piece ** np.arange(STIFFNESS.orders))
        min_stiffness, max_stiffness = (row[instants] for row in self._admissible)
        further_bounds = np.ones((self._motion.further_bounds, len(time)), dtype=bool)
        return Group(
            functions=self._motion,
            instants=instants,
            basis=basis,
            unknowns=np.arange(basis.shape[2]),
            weights=self._criterion.weights(time),
            bound_mask=np.concatenate([np.isfinite([min_stiffness, max_stiffness]), further_bounds]),
            scales=np.append(row_scales, np.ones(levels)),
        )

    def _append_level(self, full_group: Group, start: FloatArray) -> FloatArray:
        """Return a start with a level appended that bounds its values, if the cost is a level."""
        if not self._criterion.levels:
            return start
        drive_variables = self._motion.driven((full_group.basis[:-1, :, :-1] @ start), full_group.instants)
        level = self._criterion.of(self._joint, drive_variables, self._load.time) / self._motion.scale.cost
        return np.append(start, FIRST_LEVEL * level)

    def _violated_instants(self, full_group: Group, unknowns: FloatArray) -> IndexArray:
        """Return the instants to add because bounds are violated there."""
        violations = full_group.bounds(full_group.rows(unknowns)) - CLEARANCE
        violations[len(self._motion.bound_names) :] -= LEVEL_TOLERANCE
        return violated_instants(violations)

    def _refinements(self, coarse: _Attempt, pieces: int) -> list[_Attempt]:
        """Return the attempt, and those with finer pieces as long as these lower the cost.

        Bounds are kept at some instants, among them those at which the coarser splines violate them.
        """
        time, attempts = self._load.time, [coarse]
        start_profile = self._basis(coarse.space)[0] @ coarse.start
        for finer_pieces in self._finer_piece_counts(pieces):
            coarser, space = attempts[-1], self._space(finer_pieces)
            full_group = self._group(coarser.space, np.arange(len(time)))
            required_instants = np.union1d(
                coarser.instants, self._violated_instants(full_group, coarser.minimum.unknowns)
            )
            instants = np.union1d(evenly(len(time), INSTANTS_PER_PIECE * finer_pieces + 1), required_instants)
            finer = self._finer_attempt(
                space, instants, coarser, self._fitted_coefficients(space, start_profile)
            )
            # of equal costs, that at more instants is the more accurate one
            if finer is None or not finer.reaches(coarser, MIN_COST_DECREASE):
                break
            attempts.append(finer)
            cost_decrease = coarser.minimum.cost - finer.minimum.cost
            if cost_decrease + ROUGH_GAP <= MIN_COST_DECREASE * abs(finer.minimum.cost):
                break
        return attempts

    def _finer_attempt(
        self, space: SplineSpace, instants: IndexArray, coarse: _Attempt, start: FloatArray
    ) -> _Attempt | None:
        """Return a minimum among finer splines near one among coarser splines, or None."""
        full_group = self._group(space, np.arange(len(self._load.time)))
        problem = SeparableProblem([self._group(space, instants)])
        profile = self._basis(coarse.space)[0] @ coarse.minimum.unknowns[: coarse.space.size]
        near_start = self._append_level(full_group, self._fitted_coefficients(space, profile))
        interior_start = interior(problem, near_start, self._append_level(full_group, start))
        if interior_start is None:
            return None
        (minimum,) = rough_minima(problem, [interior_start], [self._motion], WARM_GAP)
        self._progress()
        return _Attempt(space, minimum, instants, start)

    def _optimized_profile(self, attempt: _Attempt, starts: int, agreeing: int) -> OptimizedStiffness:
        coefficients = attempt.minimum.unknowns[: attempt.space.size]
        rows = self._basis(attempt.space) @ coefficients
        return OptimizedStiffness(
            rows=rows,
            steps=self._load.steps,
            found=attempt.minimum.found,
            starts=starts,
            agreeing=agreeing,
            bounding=self._active_bound_shares(rows),
        )

    def _active_bound_shares(self, rows: FloatArray) -> dict[str, float]:
        """Return the share of the time during which each bound is active, by name of the bound."""
        all_instants = np.arange(len(self._load.time))
        _, bounds = self._motion((*rows, *[0.0 * rows[0]] * self._criterion.levels), all_instants)
        shares = [float(np.mean(bound > -ACTIVE_TOLERANCE)) for bound in bounds]
        return {name: share for name, share in zip(self._motion.bound_names, shares, strict=False) if share}
