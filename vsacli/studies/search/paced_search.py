"""Search over the pace along a path, and the stiffness if it varies, for the least time or cost.

`PacedSearch` tries several starts and refines the best; `timing_search` minimizes the time,
`CheapestPaceSearch` a cost at the commanded duration.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.dynamics.losses import trapezoidal_weights
from vsacli.studies.search.acceptance import ImpossibleError
from vsacli.studies.search.criteria import rough_minima, smoothed_minimum
from vsacli.studies.search.interior_point import FIRST_GAP, WARM_GAP, Minimum
from vsacli.studies.search.loads import Ends
from vsacli.studies.search.paced_motion import (
    CLEARANCE,
    PACE_ORDERS,
    Pace,
    PacedJoint,
    PacedMotion,
)
from vsacli.studies.search.separable import Group, SeparableProblem, interior, violated_instants
from vsacli.studies.search.splines import PacedSpaces, Pacing, group_of_rows

INSTANTS_PER_PIECE = 12
"""Smallest number of instants per piece at which bounds are kept."""

MAX_ROUNDS = 12
"""Limit on rounds that add instants of violated bounds: a motion with two dwells, bounded only by the ends of
its attainable ranges, required seven."""

MIN_COST_ADVANTAGE = 1e-4
"""Share of the best cost by which a start must be lower while bounds are kept at some instants only."""

ACTIVE_TOLERANCE = 1e-2
"""Relative distance from a bound below which it is active; barriers keep a motion a thousandth away."""

RANDOM_PACES, LEVELS = 2, 6
"""Number of random paces among the starts, and of the random levels that each of them interpolates."""

Start = tuple[FloatArray, FloatArray | None]
"""Unknowns near which to start, and unknowns that keep all bounds, if any are known."""


class PacedSearch(ABC):
    """The common part of the searches along a path for least time and for least cost.

    Attributes:
        pieces: numbers of pieces of the splines, first for several starts, then for refinements.
        same_cost: relative difference of costs up to which two starts reached the same optimum.
        timed: whether time is the cost.
        worth: relative decrease of the cost by a refinement that justifies the next one.
        nothing_kept: clause that explains that no start led to a result.

    Args:
        motion: motion along the path.
        joints: cost and bounds of each joint.
        varied: indices of the joints whose stiffness varies as well.
        seed: seed of the random starts.
        progress: function to call after each search.
    """

    pieces: ClassVar[tuple[int, ...]]
    same_cost: ClassVar[float]
    worth: ClassVar[float] = 0.0
    timed: ClassVar[bool]
    nothing_kept: ClassVar[str]

    def __init__(
        self,
        motion: PacedMotion,
        joints: Sequence[PacedJoint],
        varied: Sequence[int],
        seed: int,
        progress: Callable[[], None],
    ) -> None:
        self._motion, self._joints, self._varied = motion, joints, varied
        self._seed, self._progress = seed, progress
        self._s = motion.s
        self._span = float(motion.s[0]), float(motion.s[-1])
        self._scale = self._span[1]

    @abstractmethod
    def _spaces(self, pieces: int) -> PacedSpaces:
        """Return the spaces of splines with this many pieces."""

    @abstractmethod
    def _starts(self, spaces: PacedSpaces) -> Sequence[Start]:
        """Return the starts.

        Raises:
            ImpossibleError: no start was found.
        """

    @abstractmethod
    def _refined_start(self, spaces: PacedSpaces, rows: Mapping[int | None, FloatArray]) -> Start:
        """Return a start among finer splines, near the pace (key None) and the stiffness of joints."""

    @abstractmethod
    def _minima(
        self, problem: SeparableProblem, starts: Sequence[FloatArray], gap: float
    ) -> Sequence[Minimum]:
        """Return a minimum of the cost near each start; the first barrier raises it by `gap`."""

    @abstractmethod
    def _accepted(self, spaces: PacedSpaces, every: Sequence[Group], found: Minimum) -> Minimum | None:
        """Return the minimum, possibly slowed down, if it keeps all bounds at every instant; else None."""

    def best(self) -> Pacing:
        """Return the best pace, and stiffness if it varies, found from several starts.

        Raises:
            ImpossibleError: nothing was found.
        """
        pieces, *finer_pieces = self.pieces
        spaces = self._spaces(pieces)
        starts = self._starts(spaces)
        best, agreeing = self._best_minimum(spaces, self._instants(pieces), starts)
        for pieces in finer_pieces:
            finer = self._spaces(pieces)
            start = self._refined_start(finer, self._rows(spaces, best))
            try:
                refined, _ = self._best_minimum(finer, self._instants(pieces), [start])
            except ImpossibleError:
                break
            if refined.cost > best.cost:
                break
            cost_decrease, spaces, best = best.cost - refined.cost, finer, refined
            if cost_decrease <= self.worth * abs(best.cost):
                break
        return self._pacing(spaces, best, len(starts), agreeing)

    def _rows(self, spaces: PacedSpaces, minimum: Minimum) -> dict[int | None, FloatArray]:
        """Return the pace (key None) and the stiffness of joints (key: index) at every instant."""
        return {
            key: space.offset + space.basis(self._s, 1)[0] @ minimum.unknowns[unknown_indices]
            for key, (space, unknown_indices) in spaces.parts().items()
        }

    def _random_paces(self, min_pace: float, max_pace: float) -> list[FloatArray]:
        """Return random paces between two values, each (instants,)."""
        generator = np.random.default_rng(self._seed)
        level_instants = np.linspace(*self._span, LEVELS)
        return [
            np.interp(self._s, level_instants, generator.uniform(min_pace, max_pace, LEVELS))
            for _ in range(RANDOM_PACES)
        ]

    def _instants(self, pieces: int) -> IndexArray:
        """Return the instants at which bounds of splines with this many pieces are kept at first."""
        return evenly(len(self._s), INSTANTS_PER_PIECE * pieces + 1)

    def _best_minimum(
        self, spaces: PacedSpaces, instants: IndexArray, starts: Sequence[Start]
    ) -> tuple[Minimum, int]:
        """Return the best minimum that keeps all bounds, and the number of starts that reached it.

        Bounds at further instants only raise a cost: starts whose minimum without them is no better than the
        best result are discarded.

        Raises:
            ImpossibleError: no start led to any.
        """
        problem, best = SeparableProblem(self._groups(spaces, instants)), None
        starts_inside = [(interior(problem, wanted, inside), inside) for wanted, inside in starts]
        valid_starts = [(unknowns, inside) for unknowns, inside in starts_inside if unknowns is not None]
        minima = (
            self._minima(problem, [unknowns for unknowns, _ in valid_starts], FIRST_GAP)
            if valid_starts
            else []
        )
        self._progress()
        pairs = zip(minima, (inside for _, inside in valid_starts), strict=True)
        for minimum, inside in sorted(pairs, key=lambda pair: pair[0].cost):
            if best is not None and minimum.cost > best[0].cost - MIN_COST_ADVANTAGE * abs(best[0].cost):
                break
            full_minimum = self._full_minimum(spaces, instants, minimum, inside)
            if full_minimum is not None and (best is None or full_minimum.cost < best[0].cost):
                best = full_minimum, minimum.cost
        if best is None:
            raise ImpossibleError(self.nothing_kept)
        best_minimum, rough_cost = best
        return best_minimum, sum(
            each.cost <= rough_cost + self.same_cost * abs(rough_cost) for each in minima
        )

    def _full_minimum(
        self, spaces: PacedSpaces, instants: IndexArray, minimum: Minimum, interior_point: FloatArray | None
    ) -> Minimum | None:
        """Return a minimum after adding the instants at which it violates bounds, or None."""
        full_groups = self._groups(spaces, np.arange(len(self._s)))
        for _ in range(MAX_ROUNDS):
            accepted = self._accepted(spaces, full_groups, minimum)
            if accepted is not None:
                return accepted
            bounds = np.concatenate([group.bounds(group.rows(minimum.unknowns)) for group in full_groups])
            instants = np.union1d(instants, violated_instants(bounds - CLEARANCE / 2))
            problem = SeparableProblem(self._groups(spaces, instants))
            interior_start = interior(problem, minimum.unknowns, interior_point)
            if interior_start is None:
                return None
            (minimum,) = self._minima(problem, [interior_start], WARM_GAP)
            self._progress()
        return None

    def _groups(self, spaces: PacedSpaces, instants: IndexArray) -> list[Group]:
        """Return the groups of the problem at some instants: the pace alone, and each joint."""
        s = self._s[instants]
        pace = spaces.rows(None, s, PACE_ORDERS)
        pace_functions = Pace(self._motion.resting, self._scale)
        groups = [
            group_of_rows(
                pace_functions, instants, pace.first(), trapezoidal_weights(s)[None] * self.timed, 1
            )
        ]
        for index, joint in enumerate(self._joints):
            rows = pace
            if index in spaces.stiffness:
                stiffness_scale = float(np.median(self._motion.stiffness(index)))
                rows = rows.beside(spaces.rows(index, s, STIFFNESS.orders, stiffness_scale))
            if joint.criterion.levels:
                rows = rows.beside(spaces.level(s))
            groups.append(group_of_rows(joint, instants, rows, joint.weights(s), joint.bound_count))
        return groups

    def _pacing(self, spaces: PacedSpaces, best: Minimum, starts: int, agreeing: int) -> Pacing:
        parts = spaces.parts()
        return Pacing(
            splines={
                key: (space, best.unknowns[unknown_indices])
                for key, (space, unknown_indices) in parts.items()
            },
            found=best.found,
            starts=starts,
            agreeing=agreeing,
            bounding=self._active_bound_shares(spaces, best.unknowns),
        )

    def _active_bound_shares(self, spaces: PacedSpaces, unknowns: FloatArray) -> dict[str, dict[str, float]]:
        """Return the share of the path on which each bound is active, by joint and name of the bound."""
        _, *groups = self._groups(spaces, np.arange(len(self._s)))
        shares_of_path = trapezoidal_weights(self._s) / self._span[1]
        shares_by_joint: dict[str, dict[str, float]] = {}
        for joint, group in zip(self._joints, groups, strict=True):
            path_shares = (group.bounds(group.rows(unknowns)) > -ACTIVE_TOLERANCE) @ shares_of_path
            shares: dict[str, float] = {}
            for name, share in zip(joint.bound_names, path_shares.tolist(), strict=False):
                if share:
                    shares[name] = shares.get(name, 0.0) + share
            if shares:
                shares_by_joint[joint.name] = shares
        return shares_by_joint


STIFFNESS_FACTORS = 1.0, 1.5, 2.0
"""Multiples of the first stiffness for further starts."""

RANDOM_PACE_RANGE = 0.6, 1.6
"""Range of the random paces before they are scaled to the duration."""

LIFTED = 1.1
"""Factor on a stiffness from which a search starts: from an end of the attainable range, where the optimum
often is, a pendulum required more than 200 Newton steps, and from here 50."""

FIRST_LEVEL = 1.05
"""Initial level, as a multiple of the largest value that it bounds."""


class CheapestPaceSearch(PacedSearch):
    """A search for the timing of least cost at the commanded duration.

    Args:
        motion: motion along the path.
        joints: cost and bounds of each joint.
        varied: indices of the joints whose stiffness varies as well.
        ends: ends of the motion.
        seed: seed of the random starts.
        progress: function to call after each search.
        near: pace and stiffness near which to start, scaled to the duration, if the path is infeasible as
            commanded.
    """

    pieces = (12, 24, 48)
    same_cost = 1e-3
    worth = 1e-3
    timed = False
    nothing_kept = "no pace that was tried keeps every limit at all instants within the duration"

    def __init__(
        self,
        motion: PacedMotion,
        joints: Sequence[PacedJoint],
        varied: Sequence[int],
        ends: Ends,
        seed: int,
        progress: Callable[[], None],
        near: Pacing | None = None,
    ) -> None:
        super().__init__(motion, joints, varied, seed, progress)
        self._ends, self._near_pacing = ends, near

    def _spaces(self, pieces: int) -> PacedSpaces:
        return PacedSpaces.of(self._span, pieces, self._varied, self._ends).lasting_as_commanded()

    def _starts(self, spaces: PacedSpaces) -> Sequence[Start]:
        """Return the commanded pace with several stiffnesses, and random paces with the first of these."""
        start_stiffness = {joint: LIFTED * self._motion.stiffness(joint) for joint in self._varied}
        pace = np.ones_like(self._s)
        if self._near_pacing is not None:
            pace, start_stiffness = (
                self._scaled_to_duration(self._near_pacing.pace()(self._s)),
                self._near_pacing.stiffness_at(self._s),
            )
        first_start = self._append_level(spaces, spaces.fitted(self._s, pace, start_stiffness))
        interior_point = first_start if self._keeps_bounds(spaces, first_start) else None
        stiffness_choices = [
            {joint: multiple * row for joint, row in start_stiffness.items()}
            for multiple in (STIFFNESS_FACTORS if self._varied else (1.0,))
        ]
        starts = [spaces.fitted(self._s, pace, stiffness) for stiffness in stiffness_choices]
        starts += [
            spaces.fitted(self._s, self._scaled_to_duration(pace * random_pace), start_stiffness)
            for random_pace in self._random_paces(*RANDOM_PACE_RANGE)
        ]
        return [(self._append_level(spaces, unknowns), interior_point) for unknowns in starts]

    def _scaled_to_duration(self, pace: FloatArray) -> FloatArray:
        """Return a pace scaled to the commanded duration, (instants,)."""
        return pace * (self._span[1] / np.trapezoid(pace, self._s))

    def _refined_start(self, spaces: PacedSpaces, rows: Mapping[int | None, FloatArray]) -> Start:
        stiffness = {key: LIFTED * row for key, row in rows.items() if key is not None}
        return self._append_level(spaces, spaces.fitted(self._s, rows[None], stiffness)), None

    def _keeps_bounds(self, spaces: PacedSpaces, unknowns: FloatArray) -> bool:
        problem = SeparableProblem(self._groups(spaces, np.arange(len(self._s))))
        ((_, bounds),) = problem.costs_and_bounds([unknowns])
        return bool(np.all(bounds < 0))

    def _append_level(self, spaces: PacedSpaces, unknowns: FloatArray) -> FloatArray:
        """Return unknowns with a level appended that bounds its values, if the cost is a level."""
        if not self._joints[0].criterion.levels:
            return unknowns
        unknowns_at_zero = np.append(unknowns, 0.0)
        _, *groups = self._groups(spaces, np.arange(len(self._s)))
        level_bounds = [
            group.bounds(group.rows(unknowns_at_zero))[len(joint.bound_names) :]
            for joint, group in zip(self._joints, groups, strict=True)
        ]
        return np.append(unknowns, FIRST_LEVEL * float(np.nan_to_num(np.concatenate(level_bounds)).max()))

    def _minima(
        self, problem: SeparableProblem, starts: Sequence[FloatArray], gap: float
    ) -> Sequence[Minimum]:
        if gap > WARM_GAP:
            return rough_minima(problem, starts, self._joints, gap)
        return [smoothed_minimum(problem, start, gap, self._joints) for start in starts]

    def _accepted(self, _spaces: PacedSpaces, every: Sequence[Group], found: Minimum) -> Minimum | None:
        ((_, bounds),) = SeparableProblem(every).costs_and_bounds([found.unknowns])
        return found if np.all(bounds <= CLEARANCE / 2) else None
