"""The pace along a path, and the stiffness if that varies, too, with which a motion takes the least time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.robot.model import Robot
from vsacli.studies.optimisation.criteria import trapezoidal
from vsacli.studies.optimisation.interior_point import FIRST_GAP, WARM_GAP, Minimum, minimise
from vsacli.studies.optimisation.paced_joints import CLEARANCE, FASTEST, Pace, PacedJoint
from vsacli.studies.optimisation.paced_motion import PACE_ORDERS, PacedMotion
from vsacli.studies.optimisation.paced_splines import PacedSpaces, Pacing, joined_rows
from vsacli.studies.optimisation.separable import Group, SeparableProblem, interior
from vsacli.studies.remedies.acceptance import ImpossibleError
from vsacli.studies.remedies.nearest_spline import peaks
from vsacli.trajectory.trajectory import Trajectory

PIECES = (12, 24)
"""Pieces of the splines, first with several starts, then finer."""

INSTANTS_PER_PIECE = 12
"""Instants of a piece at which bounds are kept, at least."""

LOOKED_AT, FEW = 4000, 100
"""Instants at which bounds are looked at to see where they are missed, and in a first look, at most."""

NEAR_END, TOWARDS_END = (1e-5, 0.05), 150
"""Shares of the path between which further instants towards each end are, and how many: where an arm with
a hardening spring started, torques between even instants were 8e-4 larger than at them."""

SLOWEST, STRIDE = 1000.0, 1.1
"""Factors of uniform slow-downs that are looked at: each so much larger than the one before."""

HALVINGS = 16
"""Halvings of the last stride: to 1e-6 of the factor."""

UNBOUNDED = 1.1
"""Multiple of the least pace that is tried, below which nothing else holds the motion back."""

SLACK = 1.02
"""How much slower than the fastest uniform motion a search begins."""

STIFFER = (1.0, 0.8, 1.5, 2.2)
"""Multiples of the commanded stiffness to begin with, if it may vary."""

DRAWN, LEVELS = 2, 6
"""Paces that are drawn to begin with, and levels between which each of them is interpolated."""

SLOWER = (0.0, 1e-5, 1e-4, 3e-4)
"""By how much a motion may be slowed down so that it keeps all bounds between instants as well."""

LAST_TIMING_GAP = 1e-4
"""What bounds may raise the time by at the end, relative to a uniform motion: near them steps are short."""

STALLED_TIMING = 3e-4
"""Share of the time that some steps together must gain."""

MOST_ROUNDS = 6
"""Rounds of adding instants at which bounds are missed."""

SAME_COST = 1e-2
"""Relative difference of times up to which two starts came to the same optimum."""

ACTIVE = 1e-3
"""How near a bound, relative to it, a motion runs along it."""


class TimingSearch:
    """A search for the fastest pace along the path of a trajectory from rest to rest.

    Args:
        robot: the robot.
        trajectory: the path.
        near_singular: the margin that is kept.
        varied: the joints whose stiffness varies as well, by index.
        seed: of the starts that are drawn.
        progress: called after each search.
    """

    def __init__(
        self,
        robot: Robot,
        trajectory: Trajectory,
        near_singular: float,
        varied: Sequence[int],
        seed: int,
        progress: Callable[[], None],
    ) -> None:
        self._robot, self._varied, self._seed, self._progress = robot, varied, seed, progress
        self._span = (0.0, trajectory.duration)
        self._s = _instants(trajectory)
        self._motion = PacedMotion(robot, trajectory, self._s)
        self._joints = [PacedJoint(self._motion, index, near_singular) for index in range(len(robot.joints))]
        self._scale = trajectory.duration

    def fastest(self) -> Pacing:
        """The fastest pace that is found.

        Raises:
            ImpossibleError: none was found.
        """
        spaces = PacedSpaces.of(self._span, PIECES[0], self._varied)
        uniform, begun = self._starts(spaces)
        if not begun:
            raise ImpossibleError("no slow-down or speed-up of the whole motion keeps every limit")
        self._scale = uniform if math.isfinite(uniform) else self._scale
        attempts = [self._attempt(spaces, PIECES[0], *start) for start in begun]
        kept = [attempt for attempt in attempts if attempt is not None]
        if not kept:
            raise ImpossibleError("no faster pace that was tried keeps every limit at all instants")
        best = min(kept, key=lambda minimum: minimum.cost)
        agreeing = sum(minimum.cost <= (1 + SAME_COST) * best.cost for minimum in kept)
        for pieces in PIECES[1:]:
            finer = PacedSpaces.of(self._span, pieces, self._varied)
            slower = self._in(finer, spaces, best.unknowns)
            refined = self._attempt(finer, pieces, slower, slower)
            if refined is None or refined.cost > best.cost:
                break
            spaces, best = finer, refined
        found = self._pacing(spaces, best, uniform, len(begun), agreeing)
        if float(found.pace(self._s).min()) < UNBOUNDED * FASTEST:
            raise ImpossibleError(
                f"no limit keeps the motion from being {1 / FASTEST:g} times as fast; give some, such as "
                "max_torque of the motors, or begin with a shorter duration"
            )
        return found

    def _starts(self, spaces: PacedSpaces) -> tuple[float, list[tuple[FloatArray, FloatArray]]]:
        """The duration of the fastest uniform motion, and unknowns to begin with, each with some inside."""
        asked = {joint: self._motion.stiffness(joint) for joint in self._varied}
        begun, uniform = [], math.nan
        generator = np.random.default_rng(self._seed)
        places = np.linspace(*self._span, LEVELS)
        for multiple in STIFFER if self._varied else STIFFER[:1]:
            stiffness = {joint: multiple * row for joint, row in asked.items()}
            factor = self._uniform(spaces, stiffness)
            if factor is None:
                continue
            if multiple == 1:
                uniform = factor * self._span[1]
            inside = spaces.fitted(self._s, np.full_like(self._s, SLACK * factor), stiffness)
            begun.append((inside, inside))
            for _ in range(DRAWN if multiple == 1 else 0):
                drawn = np.interp(self._s, places, generator.uniform(SLACK, 2.0, LEVELS))
                begun.append((spaces.fitted(self._s, factor * drawn, stiffness), inside))
        return uniform, begun

    def _uniform(self, spaces: PacedSpaces, stiffness: Mapping[int, FloatArray]) -> float | None:
        """The least pace that is the same everywhere and keeps all bounds; None if none does."""
        few = self._groups(spaces, evenly(len(self._s), FEW))
        every = self._groups(spaces, np.arange(len(self._s)))

        def kept(groups: Sequence[Group], factor: float) -> bool:
            unknowns = spaces.fitted(self._s, np.full_like(self._s, factor), stiffness)
            _, bounds = SeparableProblem(groups).values(unknowns)
            return bool(np.all(bounds < 0))

        factor = FASTEST
        while not (kept(few, SLACK * factor) and kept(every, factor) and kept(every, SLACK * factor)):
            factor *= STRIDE
            if factor > SLOWEST:
                return None
        refused = factor / STRIDE
        for _ in range(HALVINGS):
            middle = math.sqrt(refused * factor)
            refused, factor = (refused, middle) if kept(every, middle) else (middle, factor)
        return factor

    def _in(self, finer: PacedSpaces, spaces: PacedSpaces, unknowns: FloatArray) -> FloatArray:
        """The same in finer spaces, and a little slower, since the way out of a corner is long."""
        rows = {
            key: space.basis(self._s, 1)[0] @ unknowns[own] for key, (space, own) in spaces.parts().items()
        }
        pace = SLACK * rows.pop(None)
        return finer.fitted(self._s, pace, {key: row for key, row in rows.items() if key is not None})

    def _attempt(
        self,
        spaces: PacedSpaces,
        pieces: int,
        wanted: FloatArray,
        inside: FloatArray,
    ) -> Minimum | None:
        """Search from what is wanted, with as many instants as it takes; None if nothing keeps all bounds."""
        instants = evenly(len(self._s), INSTANTS_PER_PIECE * pieces + 1)
        every, gap = self._groups(spaces, np.arange(len(self._s))), FIRST_GAP
        for _ in range(MOST_ROUNDS):
            problem = SeparableProblem(self._groups(spaces, instants))
            begun = interior(problem, wanted, inside)
            if begun is None:
                return None
            found, gap = minimise(problem, begun, gap, LAST_TIMING_GAP, STALLED_TIMING), WARM_GAP
            self._progress()
            kept = self._barely_slower(spaces, every, found)
            if kept is not None:
                return kept
            bounds = [row for group in every for row in group.bounds(group.rows(found.unknowns))]
            worst = np.concatenate([peaks(row - CLEARANCE / 2) for row in bounds])
            instants, wanted = np.union1d(instants, worst), found.unknowns
        return None

    def _barely_slower(self, spaces: PacedSpaces, every: Sequence[Group], found: Minimum) -> Minimum | None:
        """The same so little slower that all bounds are kept at every instant; None if that takes more."""
        _, own = spaces.parts()[None]
        for share in SLOWER:
            unknowns = found.unknowns.copy()
            unknowns[own] *= 1 + share
            cost, bounds = SeparableProblem(every).values(unknowns)
            if np.all(bounds <= CLEARANCE / 2):
                return replace(found, unknowns=unknowns, cost=cost)
        return None

    def _groups(self, spaces: PacedSpaces, instants: IndexArray) -> list[Group]:
        """Time with the bounds of the pace, and the bounds of each joint, at some instants."""
        parts, s = spaces.parts(), self._s[instants]
        space, own = parts[None]
        pace, sizes = space.basis(s, PACE_ORDERS), space.piece ** -np.arange(PACE_ORDERS, dtype=np.float64)
        there = np.ones((1, len(s)), dtype=bool)
        weights = trapezoidal(s)[None]
        of_pace = Pace(self._motion.resting, self._scale)
        groups = [Group(of_pace, instants, pace[:1], own, weights, there, sizes[:1])]
        for index, joint in enumerate(self._joints):
            basis, places, scales = pace, own, sizes
            if index in spaces.stiffness:
                of_joint, further = parts[index]
                basis = joined_rows(pace, of_joint.basis(s, STIFFNESS.orders))
                size = float(np.median(self._motion.stiffness(index)))
                rates = size * of_joint.piece ** -np.arange(STIFFNESS.orders, dtype=np.float64)
                places, scales = np.append(own, further), np.append(sizes, rates)
            there = np.ones((len(joint.bound_names), len(s)), dtype=bool)
            groups.append(Group(joint, instants, basis, places, np.zeros((0, len(s))), there, scales))
        return groups

    def _pacing(
        self, spaces: PacedSpaces, best: Minimum, uniform: float, starts: int, agreeing: int
    ) -> Pacing:
        parts = spaces.parts()
        splines = {key: space.spline(best.unknowns[own]) for key, (space, own) in parts.items()}
        pace = splines[None]
        return Pacing(
            pace=pace,
            stiffness={key: spline for key, spline in splines.items() if key is not None},
            duration=float(pace.integrate(*self._span)),
            uniform=uniform,
            found=best.found,
            starts=starts,
            agreeing=agreeing,
            bounding=self._bounding(spaces, best.unknowns),
        )

    def _bounding(self, spaces: PacedSpaces, unknowns: FloatArray) -> dict[str, dict[str, float]]:
        """Share of the path along each bound."""
        _, *groups = self._groups(spaces, np.arange(len(self._s)))
        found: dict[str, dict[str, float]] = {}
        for joint, functions, group in zip(self._robot.joints, self._joints, groups, strict=True):
            along = np.mean(group.bounds(group.rows(unknowns)) > -ACTIVE, axis=1)
            shares: dict[str, float] = {}
            for name, share in zip(functions.bound_names, along.tolist(), strict=True):
                if share:
                    shares[name] = shares.get(name, 0.0) + share
            if shares:
                found[joint.name] = shares
        return found


def _instants(trajectory: Trajectory) -> FloatArray:
    """Where bounds are looked at, s: evenly, and more and more densely towards both ends.

    A motion that begins at rest has hardly begun where its pace, which may be high there, is past its worst.
    """
    even = np.linspace(0.0, 1.0, min(2 * trajectory.samples - 1, LOOKED_AT))
    towards = np.geomspace(*NEAR_END, TOWARDS_END)
    return trajectory.duration * np.unique(np.concatenate([even, towards, 1 - towards]))
