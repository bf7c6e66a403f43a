"""A search along a path over the pace, and the stiffness if that varies: what all of them have in common."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.studies.optimisation.criteria import trapezoidal
from vsacli.studies.optimisation.interior_point import FIRST_GAP, WARM_GAP, Minimum
from vsacli.studies.optimisation.paced_joints import CLEARANCE, Pace, PacedJoint
from vsacli.studies.optimisation.paced_motion import PACE_ORDERS, PacedMotion
from vsacli.studies.optimisation.paced_splines import PacedSpaces, Pacing, of_rows
from vsacli.studies.optimisation.separable import Group, SeparableProblem, interior
from vsacli.studies.remedies.acceptance import ImpossibleError
from vsacli.studies.remedies.nearest_spline import peaks
from vsacli.trajectory.trajectory import Trajectory

LOOKED_AT = 4000
"""Instants at which bounds are looked at to see where they are missed, at most."""

FEWEST_LOOKED_AT = 1000
"""The same at least, however few steps a motion has."""

NOTHING = np.empty(0)

NEAR_END, TOWARDS_END = (1e-5, 0.05), 150
"""Shares of the path between which further instants towards each end are, and how many: where an arm with
a hardening spring started, torques between even instants were 8e-4 larger than at them."""

INSTANTS_PER_PIECE = 12
"""Instants of a piece at which bounds are kept, at least."""

MOST_ROUNDS = 12
"""Rounds of adding instants at which bounds are missed: a motion with two dwells, bounded by the ends of its
corridors alone, took seven."""

ACTIVE = 1e-2
"""How near a bound, relative to it, a motion runs along it: barriers keep the fastest a thousandth away."""

STIFFER = (1.0, 0.8, 1.5, 2.2)
"""Multiples of the commanded stiffness to begin with, if it may vary."""

DRAWN, LEVELS = 2, 6
"""Paces that are drawn to begin with, and levels between which each of them is interpolated."""

Start = tuple[FloatArray, FloatArray | None]
"""Unknowns to begin near, and some that keep all bounds, if these are known."""


class PacedSearch:
    """What searches along a path have in common; those for the least time and the least cost derive from it.

    Attributes:
        pieces: of the splines, first with several starts, then finer.
        same_cost: relative difference of costs up to which two starts came to the same optimum.
        timed: whether time is the cost.
        worth: share of the cost that finer pieces must gain for still finer ones.
        nothing_kept: why nothing was found where no start led to anything, in a clause.

    Args:
        motion: along the path.
        joints: cost and bounds of each.
        varied: the joints whose stiffness varies as well, by index.
        seed: of the starts that are drawn.
        progress: called after each search.
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
        """The splines of so many pieces among which is searched."""
        raise NotImplementedError

    def _starts(self, spaces: PacedSpaces) -> Sequence[Start]:
        """Where to begin.

        Raises:
            ImpossibleError: there is no start.
        """
        raise NotImplementedError

    def _refined_start(self, spaces: PacedSpaces, rows: Mapping[int | None, FloatArray]) -> Start:
        """Where to begin among finer splines: near the pace, None, and the stiffness of joints, by index."""
        raise NotImplementedError

    def _minimum(self, problem: SeparableProblem, start: FloatArray, gap: float) -> Minimum:
        """Of the cost; bounds raise it at first by a gap."""
        raise NotImplementedError

    def _accepted(self, spaces: PacedSpaces, every: Sequence[Group], found: Minimum) -> Minimum | None:
        """What was found, if it keeps all bounds at every instant."""
        raise NotImplementedError

    def best(self) -> Pacing:
        """The best that is found from several starts.

        Raises:
            ImpossibleError: nothing was found.
        """
        pieces, *further = self.pieces
        spaces = self._spaces(pieces)
        starts = self._starts(spaces)
        attempts = [self._attempt(spaces, pieces, *start) for start in starts]
        kept = [attempt for attempt in attempts if attempt is not None]
        if not kept:
            raise ImpossibleError(self.nothing_kept)
        best = min(kept, key=lambda minimum: minimum.cost)
        agreeing = sum(minimum.cost <= best.cost + self.same_cost * abs(best.cost) for minimum in kept)
        for pieces in further:
            finer = self._spaces(pieces)
            refined = self._attempt(finer, pieces, *self._refined_start(finer, self._rows(spaces, best)))
            if refined is None or refined.cost > best.cost:
                break
            gained, spaces, best = best.cost - refined.cost, finer, refined
            if gained <= self.worth * abs(best.cost):
                break
        return self._pacing(spaces, best, len(starts), agreeing)

    def _rows(self, spaces: PacedSpaces, found: Minimum) -> dict[int | None, FloatArray]:
        """Pace, None, and stiffness of joints, by index, at every instant."""
        return {
            key: space.offset + space.basis(self._s, 1)[0] @ found.unknowns[own]
            for key, (space, own) in spaces.parts().items()
        }

    def _drawn(self, least: float, most: float) -> list[FloatArray]:
        """Some paces between two, (instants,)."""
        generator = np.random.default_rng(self._seed)
        places = np.linspace(*self._span, LEVELS)
        return [np.interp(self._s, places, generator.uniform(least, most, LEVELS)) for _ in range(DRAWN)]

    def _attempt(
        self, spaces: PacedSpaces, pieces: int, wanted: FloatArray, inside: FloatArray | None
    ) -> Minimum | None:
        """Search from what is wanted, with as many instants as it takes; None if nothing keeps all bounds."""
        instants = evenly(len(self._s), INSTANTS_PER_PIECE * pieces + 1)
        every, gap = self._groups(spaces, np.arange(len(self._s))), FIRST_GAP
        for _ in range(MOST_ROUNDS):
            problem = SeparableProblem(self._groups(spaces, instants))
            begun = interior(problem, wanted, inside)
            if begun is None:
                return None
            found, gap = self._minimum(problem, begun, gap), WARM_GAP
            self._progress()
            kept = self._accepted(spaces, every, found)
            if kept is not None:
                return kept
            bounds = [row for group in every for row in group.bounds(group.rows(found.unknowns))]
            worst = np.concatenate([peaks(row - CLEARANCE / 2) for row in bounds])
            instants, wanted = np.union1d(instants, worst), found.unknowns
        return None

    def _groups(self, spaces: PacedSpaces, instants: IndexArray) -> list[Group]:
        """The pace by itself, and each joint, at some instants."""
        s = self._s[instants]
        pace = spaces.rows(None, s, PACE_ORDERS)
        of_pace = Pace(self._motion.resting, self._scale)
        groups = [of_rows(of_pace, instants, pace.first(), trapezoidal(s)[None] * self.timed, 1)]
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
        """Share of the path along each bound, by joint and name of the bound."""
        _, *groups = self._groups(spaces, np.arange(len(self._s)))
        shares_of_path = trapezoidal(self._s) / self._span[1]
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


def instants_of(trajectory: Trajectory, duration: float, further: FloatArray = NOTHING) -> FloatArray:
    """Where bounds are looked at, s: evenly, and more and more densely towards both ends.

    A motion that begins at rest has hardly begun where its pace, which may be high there, is past its worst.

    Args:
        trajectory: the path.
        duration: of its part that is looked at, s.
        further: instants of that part that shall be among them, s.
    """
    even = np.linspace(0.0, 1.0, min(max(2 * trajectory.samples - 1, FEWEST_LOOKED_AT), LOOKED_AT))
    towards = np.geomspace(*NEAR_END, TOWARDS_END)
    return np.union1d(duration * np.unique(np.concatenate([even, towards, 1 - towards])), further)
