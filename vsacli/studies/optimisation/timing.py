"""The pace along a path, and the stiffness if that varies, too, with which a motion takes the least time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from vsacli.base.arrays import FloatArray, evenly
from vsacli.studies.optimisation.interior_point import Minimum, minimise
from vsacli.studies.optimisation.paced_joints import CLEARANCE, FASTEST, PacedJoint, least_pace
from vsacli.studies.optimisation.paced_motion import PacedMotion
from vsacli.studies.optimisation.paced_search import STIFFER, PacedSearch, Start, instants_of
from vsacli.studies.optimisation.paced_splines import PacedSpaces, Pacing
from vsacli.studies.optimisation.periods import Ends
from vsacli.studies.optimisation.separable import Group, SeparableProblem
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError
from vsacli.trajectory.trajectory import Trajectory

FEW = 100
"""Instants at which bounds are looked at in a first look."""

SLOWEST, STRIDE = 1000.0, 1.1
"""Factors of uniform slow-downs that are looked at: each so much larger than the one before."""

HALVINGS = 16
"""Halvings of the last stride: to 1e-6 of the factor."""

UNBOUNDED = 1.1
"""Multiple of the time that the least pace takes, below which nothing else holds the motion back."""

SLACK = 1.02
"""How much slower than the fastest uniform motion a search begins."""

SLOWER = (0.0, 1e-5, 1e-4, 3e-4)
"""By how much a motion may be slowed down so that it keeps all bounds between instants as well."""

LAST_TIMING_GAP = 1e-4
"""What bounds may raise the time by at the end, relative to a uniform motion: near them steps are short."""

STALLED_TIMING = 3e-4
"""Share of the time that some steps together must gain."""


class NoStartError(ImpossibleError):
    """No stiffness that was tried makes any slow-down feasible."""


class TimingSearch(PacedSearch):
    """A search for the fastest pace along the path of a trajectory, over a period of what repeats itself.

    Args:
        acceptance: the rule, with instants of the path that count as well.
        trajectory: the path.
        ends: of the motion.
        varied: the joints whose stiffness varies as well, by index.
        seed: of the starts that are drawn.
        progress: called after each search.

    Attributes:
        uniform: duration of the fastest motion that is slowed down or sped up as a whole, s; NaN if there is
            none, or its ends move at a given pace.
    """

    pieces = (12, 24)
    same_cost = 1e-2
    timed = True
    nothing_kept = "no faster pace that was tried keeps every limit at all instants"

    def __init__(
        self,
        acceptance: Acceptance,
        trajectory: Trajectory,
        ends: Ends,
        varied: Sequence[int],
        seed: int,
        progress: Callable[[], None],
    ) -> None:
        robot, count = acceptance.robot, max(ends.periods, 1)
        instants = instants_of(trajectory, trajectory.duration / count, acceptance.between)
        motion = PacedMotion(robot, trajectory, instants)
        joints = [
            PacedJoint(
                motion,
                index,
                acceptance.near_singular,
                reserve=acceptance.reserve,
                varied=index in varied,
            )
            for index in range(len(robot.joints))
        ]
        super().__init__(motion, joints, varied, seed, progress)
        self._ends, self._count = ends, count
        self.uniform = math.nan

    def best(self) -> Pacing:
        """The fastest pace that is found.

        Raises:
            ImpossibleError: none was found.
        """
        found = super().best()
        shortest = np.trapezoid(least_pace(self._motion.resting), self._s)
        held = any(self._ends.moving)
        if not found.bounding if held else found.pace().integrate(*self._span) < UNBOUNDED * shortest:
            raise ImpossibleError(
                f"no limit keeps the motion from being {1 / FASTEST:g} times as fast; give some, such as "
                "max_torque of the motors, or begin with a shorter duration"
            )
        return found

    def _spaces(self, pieces: int) -> PacedSpaces:
        return PacedSpaces.of(self._span, pieces, self._varied, self._ends)

    def _starts(self, spaces: PacedSpaces) -> Sequence[Start]:
        asked = {joint: self._motion.stiffness(joint) for joint in self._varied}
        begun: list[Start] = []
        for multiple in STIFFER if self._varied else STIFFER[:1]:
            stiffness = {joint: multiple * row for joint, row in asked.items()}
            factor = self._uniform(spaces, stiffness)
            if factor is None:
                continue
            inside = spaces.even(self._s, SLACK * factor, stiffness)
            begun.append((inside, inside))
            if multiple == 1:
                self._scale = factor * self._span[1]
                self.uniform = math.nan if any(self._ends.moving) else self._count * self._scale
                begun += [
                    (spaces.fitted(self._s, factor * drawn, stiffness), inside)
                    for drawn in self._drawn(SLACK, 2.0)
                ]
        if not begun:
            raise NoStartError("no slow-down or speed-up of the whole motion keeps every limit")
        return begun

    def _refined_start(self, spaces: PacedSpaces, rows: Mapping[int | None, FloatArray]) -> Start:
        """A little slower, since the way out of a corner is long."""
        stiffness = {key: row for key, row in rows.items() if key is not None}
        slower = spaces.fitted(self._s, SLACK * rows[None], stiffness)
        return slower, slower

    def _uniform(self, spaces: PacedSpaces, stiffness: Mapping[int, FloatArray]) -> float | None:
        """The least pace that is the same everywhere and keeps all bounds; None if none does."""
        few = self._groups(spaces, evenly(len(self._s), FEW))
        every = self._groups(spaces, np.arange(len(self._s)))

        def kept(groups: Sequence[Group], factor: float) -> bool:
            unknowns = spaces.even(self._s, factor, stiffness)
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

    def _minimum(self, problem: SeparableProblem, start: FloatArray, gap: float) -> Minimum:
        return minimise(problem, start, gap, LAST_TIMING_GAP, STALLED_TIMING)

    def _accepted(self, spaces: PacedSpaces, every: Sequence[Group], found: Minimum) -> Minimum | None:
        """The same so little slower that all bounds are kept at every instant; None if that takes more."""
        for share in SLOWER:
            unknowns = spaces.slowed(found.unknowns, share)
            cost, bounds = SeparableProblem(every).values(unknowns)
            if np.all(bounds <= CLEARANCE / 2):
                return replace(found, unknowns=unknowns, cost=cost)
        return None
