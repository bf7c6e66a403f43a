"""Search for the fastest timing along a path, with the stiffness if it varies."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError
from vsacli.studies.search.interior_point import Minimum, minimize_all
from vsacli.studies.search.loads import Ends
from vsacli.studies.search.paced_motion import (
    CLEARANCE,
    FASTEST,
    PacedJoint,
    PacedMotion,
    instants_of,
    least_pace,
)
from vsacli.studies.search.paced_search import PacedSearch, Start
from vsacli.studies.search.separable import Group, SeparableProblem
from vsacli.studies.search.splines import PacedSpaces, Pacing
from vsacli.trajectory.trajectory import Trajectory

STIFFER_STARTS = (1.0, 0.8, 1.5, 2.2)
"""Multiples of the commanded stiffness for the starts, if it may vary."""

SLOWEST, STRIDE = 1000.0, 1.1
"""Largest factor of a uniform slow-down that is tried, and the ratio of successive factors."""

HALVINGS = 16
"""Bisections of the last stride, to 1e-6 of the factor."""

UNBOUNDED = 1.1
"""Multiple of the duration at the smallest pace below which no other bound limits the motion."""

SLACK = 1.02
"""Ratio of a start's duration to that of the fastest uniform timing."""

SLOWER = (0.0, 1e-5, 1e-4, 3e-4)
"""Relative slow-downs to try so that a motion keeps all bounds between instants as well."""

LAST_TIMING_GAP = 1e-4
"""Increase of the time by bounds at the last barrier, relative to a uniform timing: close to bounds, Newton
steps are short."""

STALLED_TIMING = 3e-4
"""Relative change of the time within `PATIENCE` Newton steps below which the search ends."""


class NoStartError(ImpossibleError):
    """Error: no stiffness that was tried makes any slow-down feasible."""


class TimingSearch(PacedSearch):
    """A search for the fastest timing along the path of a trajectory, over one period if it is periodic.

    Args:
        acceptance: acceptance rule; its `between` are values of s on the path.
        trajectory: trajectory that defines the path.
        ends: ends of the motion.
        varied: indices of the joints whose stiffness varies as well.
        seed: seed of the random starts.
        progress: function to call after each search.

    Attributes:
        uniform: duration of the fastest motion that is uniformly slowed down or sped up, s; NaN if there is
            none, or if the pace at an end is prescribed.
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
                acceptance.min_margin,
                reserve=acceptance.reserve,
                varied=index in varied,
            )
            for index in range(len(robot.joints))
        ]
        super().__init__(motion, joints, varied, seed, progress)
        self._ends, self._count = ends, count
        self.uniform = math.nan

    def best(self) -> Pacing:
        """Return the fastest timing found.

        Raises:
            ImpossibleError: none was found, or no limit bounds the speed.
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
        for multiple in STIFFER_STARTS if self._varied else STIFFER_STARTS[:1]:
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
        # a little slower, since the way out of a corner is long
        stiffness = {key: row for key, row in rows.items() if key is not None}
        slower = spaces.fitted(self._s, SLACK * rows[None], stiffness)
        return slower, slower

    def _uniform(self, spaces: PacedSpaces, stiffness: Mapping[int, FloatArray]) -> float | None:
        """Return the smallest constant pace that keeps all bounds, or None."""
        every = SeparableProblem(self._groups(spaces, np.arange(len(self._s))))
        even, pace = spaces.even(self._s, 1.0, stiffness), spaces.even(self._s, 2.0, stiffness)
        pace -= even  # unknowns that make the pace faster by one

        def kept(factor: float) -> bool:
            ((_, bounds),) = every.values([even + (factor - 1) * pace])
            return bool(np.all(bounds < 0))

        factors = FASTEST * STRIDE ** np.arange(math.ceil(math.log(SLOWEST / FASTEST) / math.log(STRIDE)))
        factor = next((each for each in factors.tolist() if kept(SLACK * each) and kept(each)), None)
        if factor is None:
            return None
        refused = factor / STRIDE
        for _ in range(HALVINGS):
            middle = math.sqrt(refused * factor)
            refused, factor = (refused, middle) if kept(middle) else (middle, factor)
        return float(factor)

    def _minima(
        self, problem: SeparableProblem, starts: Sequence[FloatArray], gap: float
    ) -> Sequence[Minimum]:
        return minimize_all(problem, starts, gap, LAST_TIMING_GAP, STALLED_TIMING)

    def _accepted(self, spaces: PacedSpaces, every: Sequence[Group], found: Minimum) -> Minimum | None:
        """Return the minimum, slowed down by a share of `SLOWER` that keeps all bounds, or None."""
        for share in SLOWER:
            unknowns = spaces.slowed(found.unknowns, share)
            ((cost, bounds),) = SeparableProblem(every).values([unknowns])
            if np.all(bounds <= CLEARANCE / 2):
                return replace(found, unknowns=unknowns, cost=cost)
        return None
