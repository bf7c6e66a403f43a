"""Search over the pace along a path, and the stiffness if it varies, for the least time or cost.

`PacedSearch` tries several starts and refines the best; `timing_search` minimizes the time, `cheapest_pace` a
cost at the commanded duration.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.dynamics.losses import trapezoidal_weights
from vsacli.studies.search.acceptance import ImpossibleError
from vsacli.studies.search.interior_point import FIRST_GAP, WARM_GAP, Minimum
from vsacli.studies.search.paced_motion import (
    CLEARANCE,
    PACE_ORDERS,
    Pace,
    PacedJoint,
    PacedMotion,
)
from vsacli.studies.search.separable import Group, SeparableProblem, interior, missed_instants
from vsacli.studies.search.splines import PacedSpaces, Pacing, of_rows

INSTANTS_PER_PIECE = 12
"""Smallest number of instants per piece at which bounds are kept."""

MOST_ROUNDS = 12
"""Limit on rounds that add instants of violated bounds: a motion with two dwells, bounded only by the ends of
its attainable ranges, required seven."""

WORTH_COMPLETING = 1e-4
"""Share of the best cost by which a start must be lower while bounds are kept at some instants only."""

ACTIVE = 1e-2
"""Relative distance from a bound below which it is active; barriers keep a motion a thousandth away."""

DRAWN, LEVELS = 2, 6
"""Number of random paces among the starts, and of the random levels that each of them interpolates."""

Start = tuple[FloatArray, FloatArray | None]
"""Unknowns near which to start, and unknowns that keep all bounds, if any are known."""


class PacedSearch:
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

    def _spaces(self, pieces: int) -> PacedSpaces:
        """Return the spaces of splines with this many pieces."""
        raise NotImplementedError

    def _starts(self, spaces: PacedSpaces) -> Sequence[Start]:
        """Return the starts.

        Raises:
            ImpossibleError: no start was found.
        """
        raise NotImplementedError

    def _refined_start(self, spaces: PacedSpaces, rows: Mapping[int | None, FloatArray]) -> Start:
        """Return a start among finer splines, near the pace (key None) and the stiffness of joints."""
        raise NotImplementedError

    def _minima(
        self, problem: SeparableProblem, starts: Sequence[FloatArray], gap: float
    ) -> Sequence[Minimum]:
        """Return a minimum of the cost near each start; the first barrier raises it by `gap`."""
        raise NotImplementedError

    def _accepted(self, spaces: PacedSpaces, every: Sequence[Group], found: Minimum) -> Minimum | None:
        """Return the minimum, possibly slowed down, if it keeps all bounds at every instant; else None."""
        raise NotImplementedError

    def best(self) -> Pacing:
        """Return the best pace, and stiffness if it varies, found from several starts.

        Raises:
            ImpossibleError: nothing was found.
        """
        pieces, *further = self.pieces
        spaces = self._spaces(pieces)
        starts = self._starts(spaces)
        best, agreeing = self._best_of(spaces, self._instants(pieces), starts)
        for pieces in further:
            finer = self._spaces(pieces)
            start = self._refined_start(finer, self._rows(spaces, best))
            try:
                refined, _ = self._best_of(finer, self._instants(pieces), [start])
            except ImpossibleError:
                break
            if refined.cost > best.cost:
                break
            gained, spaces, best = best.cost - refined.cost, finer, refined
            if gained <= self.worth * abs(best.cost):
                break
        return self._pacing(spaces, best, len(starts), agreeing)

    def _rows(self, spaces: PacedSpaces, found: Minimum) -> dict[int | None, FloatArray]:
        """Return the pace (key None) and the stiffness of joints (key: index) at every instant."""
        return {
            key: space.offset + space.basis(self._s, 1)[0] @ found.unknowns[own]
            for key, (space, own) in spaces.parts().items()
        }

    def _drawn(self, least: float, most: float) -> list[FloatArray]:
        """Return random paces between two values, each (instants,)."""
        generator = np.random.default_rng(self._seed)
        places = np.linspace(*self._span, LEVELS)
        return [np.interp(self._s, places, generator.uniform(least, most, LEVELS)) for _ in range(DRAWN)]

    def _instants(self, pieces: int) -> IndexArray:
        """Return the instants at which bounds of splines with this many pieces are kept at first."""
        return evenly(len(self._s), INSTANTS_PER_PIECE * pieces + 1)

    def _best_of(
        self, spaces: PacedSpaces, instants: IndexArray, starts: Sequence[Start]
    ) -> tuple[Minimum, int]:
        """Return the best minimum that keeps all bounds, and the number of starts that reached it.

        Bounds at further instants only raise a cost: starts whose minimum without them is no better than the
        best result are discarded.

        Raises:
            ImpossibleError: no start led to any.
        """
        problem, best = SeparableProblem(self._groups(spaces, instants)), None
        begun = [(interior(problem, wanted, inside), inside) for wanted, inside in starts]
        inner = [(unknowns, inside) for unknowns, inside in begun if unknowns is not None]
        roughly = self._minima(problem, [unknowns for unknowns, _ in inner], FIRST_GAP) if inner else []
        self._progress()
        pairs = zip(roughly, (inside for _, inside in inner), strict=True)
        for rough, inside in sorted(pairs, key=lambda pair: pair[0].cost):
            if best is not None and rough.cost > best[0].cost - WORTH_COMPLETING * abs(best[0].cost):
                break
            kept = self._completed(spaces, instants, rough, inside)
            if kept is not None and (best is None or kept.cost < best[0].cost):
                best = kept, rough.cost
        if best is None:
            raise ImpossibleError(self.nothing_kept)
        found, least = best
        return found, sum(each.cost <= least + self.same_cost * abs(least) for each in roughly)

    def _completed(
        self, spaces: PacedSpaces, instants: IndexArray, found: Minimum, inside: FloatArray | None
    ) -> Minimum | None:
        """Return a minimum after adding the instants at which it violates bounds, or None."""
        every = self._groups(spaces, np.arange(len(self._s)))
        for _ in range(MOST_ROUNDS):
            kept = self._accepted(spaces, every, found)
            if kept is not None:
                return kept
            bounds = np.concatenate([group.bounds(group.rows(found.unknowns)) for group in every])
            instants = np.union1d(instants, missed_instants(bounds - CLEARANCE / 2))
            problem = SeparableProblem(self._groups(spaces, instants))
            begun = interior(problem, found.unknowns, inside)
            if begun is None:
                return None
            (found,) = self._minima(problem, [begun], WARM_GAP)
            self._progress()
        return None

    def _groups(self, spaces: PacedSpaces, instants: IndexArray) -> list[Group]:
        """Return the groups of the problem at some instants: the pace alone, and each joint."""
        s = self._s[instants]
        pace = spaces.rows(None, s, PACE_ORDERS)
        of_pace = Pace(self._motion.resting, self._scale)
        groups = [of_rows(of_pace, instants, pace.first(), trapezoidal_weights(s)[None] * self.timed, 1)]
        for index, joint in enumerate(self._joints):
            rows = pace
            if index in spaces.stiffness:
                size = float(np.median(self._motion.stiffness(index)))
                rows = rows.beside(spaces.rows(index, s, STIFFNESS.orders, size))
            if joint.criterion.levels:
                rows = rows.beside(spaces.level(s))
            groups.append(of_rows(joint, instants, rows, joint.weights(s), joint.bound_count))
        return groups

    def _pacing(self, spaces: PacedSpaces, best: Minimum, starts: int, agreeing: int) -> Pacing:
        parts = spaces.parts()
        return Pacing(
            splines={key: (space, best.unknowns[own]) for key, (space, own) in parts.items()},
            found=best.found,
            starts=starts,
            agreeing=agreeing,
            bounding=self._bounding(spaces, best.unknowns),
        )

    def _bounding(self, spaces: PacedSpaces, unknowns: FloatArray) -> dict[str, dict[str, float]]:
        """Return the share of the path on which each bound is active, by joint and name of the bound."""
        _, *groups = self._groups(spaces, np.arange(len(self._s)))
        shares_of_path = trapezoidal_weights(self._s) / self._span[1]
        found: dict[str, dict[str, float]] = {}
        for joint, group in zip(self._joints, groups, strict=True):
            along = (group.bounds(group.rows(unknowns)) > -ACTIVE) @ shares_of_path
            shares: dict[str, float] = {}
            for name, share in zip(joint.bound_names, along.tolist(), strict=False):
                if share:
                    shares[name] = shares.get(name, 0.0) + share
            if shares:
                found[joint.name] = shares
        return found
