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
    MIN_PACE,
    PacedJoint,
    PacedMotion,
    checked_instants,
    min_pace,
)
from vsacli.studies.search.paced_search import PacedSearch, Start
from vsacli.studies.search.separable import Group, SeparableProblem
from vsacli.studies.search.splines import PacedSpaces, Pacing
from vsacli.trajectory.trajectory import Trajectory

START_STIFFNESS_FACTORS = (1.0, 0.8, 1.5, 2.2)
"""Multiples of the commanded stiffness for the starts, if it may vary."""

MAX_FACTOR, STRIDE = 1000.0, 1.1
"""Largest factor of a uniform slow-down that is tried, and the ratio of successive factors."""

HALVINGS = 16
"""Bisections of the last stride, to 1e-6 of the factor."""

UNBOUNDED_RATIO = 1.1
"""Multiple of the duration at the smallest pace below which no other bound limits the motion."""

START_DURATION_RATIO = 1.02
"""Ratio of a start's duration to that of the fastest uniform timing."""

FINAL_SLOW_DOWNS = (0.0, 1e-5, 1e-4, 3e-4)
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
        robot, period_count = acceptance.robot, max(ends.periods, 1)
        instants = checked_instants(trajectory, trajectory.duration / period_count, acceptance.between)
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
        self._ends, self._period_count = ends, period_count
        self.uniform = math.nan

    def best(self) -> Pacing:
        """Return the fastest timing found.

        Raises:
            ImpossibleError: none was found, or no limit bounds the speed.
        """
        pacing = super().best()
        min_duration = np.trapezoid(min_pace(self._motion.resting), self._s)
        has_moving_end = any(self._ends.moving)
        if (
            not pacing.bounding
            if has_moving_end
            else pacing.pace().integrate(*self._span) < UNBOUNDED_RATIO * min_duration
        ):
            raise ImpossibleError(
                f"no limit keeps the motion from being {1 / MIN_PACE:g} times as fast; give some, such as "
                "max_torque of the motors, or begin with a shorter duration"
            )
        return pacing

    def _spaces(self, pieces: int) -> PacedSpaces:
        return PacedSpaces.of(self._span, pieces, self._varied, self._ends)

    def _starts(self, spaces: PacedSpaces) -> Sequence[Start]:
        commanded_stiffness = {joint: self._motion.stiffness(joint) for joint in self._varied}
        starts: list[Start] = []
        for multiple in START_STIFFNESS_FACTORS if self._varied else START_STIFFNESS_FACTORS[:1]:
            stiffness = {joint: multiple * row for joint, row in commanded_stiffness.items()}
            factor = self._min_uniform_pace(spaces, stiffness)
            if factor is None:
                continue
            interior_point = spaces.even(self._s, START_DURATION_RATIO * factor, stiffness)
            starts.append((interior_point, interior_point))
            if multiple == 1:
                self._scale = factor * self._span[1]
                self.uniform = math.nan if any(self._ends.moving) else self._period_count * self._scale
                starts += [
                    (spaces.fitted(self._s, factor * random_pace, stiffness), interior_point)
                    for random_pace in self._random_paces(START_DURATION_RATIO, 2.0)
                ]
        if not starts:
            raise NoStartError("no slow-down or speed-up of the whole motion keeps every limit")
        return starts

    def _refined_start(self, spaces: PacedSpaces, rows: Mapping[int | None, FloatArray]) -> Start:
        # a little slower, since the way out of a corner is long
        stiffness = {key: row for key, row in rows.items() if key is not None}
        slowed_unknowns = spaces.fitted(self._s, START_DURATION_RATIO * rows[None], stiffness)
        return slowed_unknowns, slowed_unknowns

    def _min_uniform_pace(self, spaces: PacedSpaces, stiffness: Mapping[int, FloatArray]) -> float | None:
        """Return the smallest constant pace that keeps all bounds, or None."""
        problem = SeparableProblem(self._groups(spaces, np.arange(len(self._s))))
        base_unknowns, pace_direction = (
            spaces.even(self._s, 1.0, stiffness),
            spaces.even(self._s, 2.0, stiffness),
        )
        pace_direction -= base_unknowns  # unknowns that make the pace faster by one

        def kept(factor: float) -> bool:
            ((_, bounds),) = problem.costs_and_bounds([base_unknowns + (factor - 1) * pace_direction])
            return bool(np.all(bounds < 0))

        factors = MIN_PACE * STRIDE ** np.arange(
            math.ceil(math.log(MAX_FACTOR / MIN_PACE) / math.log(STRIDE))
        )
        factor = next(
            (each for each in factors.tolist() if kept(START_DURATION_RATIO * each) and kept(each)), None
        )
        if factor is None:
            return None
        refused_factor = factor / STRIDE
        for _ in range(HALVINGS):
            middle_factor = math.sqrt(refused_factor * factor)
            refused_factor, factor = (
                (refused_factor, middle_factor) if kept(middle_factor) else (middle_factor, factor)
            )
        return float(factor)

    def _minima(
        self, problem: SeparableProblem, starts: Sequence[FloatArray], gap: float
    ) -> Sequence[Minimum]:
        return minimize_all(problem, starts, gap, LAST_TIMING_GAP, STALLED_TIMING)

    def _accepted(
        self, spaces: PacedSpaces, full_groups: Sequence[Group], minimum: Minimum
    ) -> Minimum | None:
        """Return the minimum, slowed down by a share of `FINAL_SLOW_DOWNS` that keeps all bounds, or None."""
        for share in FINAL_SLOW_DOWNS:
            unknowns = spaces.slowed(minimum.unknowns, share)
            ((cost, bounds),) = SeparableProblem(full_groups).costs_and_bounds([unknowns])
            if np.all(bounds <= CLEARANCE / 2):
                return replace(minimum, unknowns=unknowns, cost=cost)
        return None
