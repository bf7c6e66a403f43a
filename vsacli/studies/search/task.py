"""A task to be fixed: its acceptance rule, the cost of changes, the fixes, and the run that confirms each.

A search yields a `Combination` of changes; `Task` turns it into a `Fix` with a trajectory and a robot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Protocol, TypeVar

import numpy as np

from vsacli.analysis.joint_report import JointReport
from vsacli.analysis.run import Run
from vsacli.base import units
from vsacli.base.arrays import FloatArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.dynamics.inverse import usual_block
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError, checked_range
from vsacli.studies.search.changed_motion import (
    rate_of,
    with_changed_stiffness,
    with_kept_rate,
    with_raised_stiffness,
)
from vsacli.studies.search.fix_report import (
    Fix,
    JointChange,
    LongerTransition,
    Offset,
    OtherBranch,
    SlowDown,
    StiffnessOffset,
    StiffnessProfile,
)
from vsacli.studies.search.loads import Load, TaskSamples, joint_loads
from vsacli.studies.search.nearest_profile import Change, nearest_change
from vsacli.studies.search.scans import (
    WATCHED_STEPS,
    smallest_offset,
)
from vsacli.studies.search.transitions import smallest_transition
from vsacli.trajectory.curves import ClosedForm
from vsacli.trajectory.times import ResampledTimes
from vsacli.trajectory.trajectory import Trajectory


class Cost(Protocol):
    """Measure of the size of changes; several costs combine as the root of the sum of their squares."""

    def of_factor(self, factor: float) -> float:
        """Return the cost of a slow-down, which is 0 for a factor of 1 and increases with the factor."""

    def of_stiffness(self, asked: FloatArray, change: FloatArray) -> float:
        """Return the cost of adding `change` to the commanded stiffness of a joint, both (samples,)."""


class _RelativeChange:
    """Size of changes relative to the command.

    A slow-down costs its factor less 1; a joint costs the rms of its change over the rms of its stiffness.
    So a motion that lasts 10 % longer costs as much as a joint that is 10 % stiffer throughout.
    """

    def of_factor(self, factor: float) -> float:
        """Return the growth of the duration, relative to the duration."""
        return factor - 1

    def of_stiffness(self, asked: FloatArray, change: FloatArray) -> float:
        """Return the rms change of the stiffness of a joint, relative to the rms stiffness."""
        return math.sqrt(float(np.mean(change**2) / np.mean(asked**2)))


RELATIVE_CHANGE: Cost = _RelativeChange()


Form = Callable[[Acceptance, Joint, Load], FloatArray]
"""Search for the addition to a joint's stiffness, (samples,), with which its load is accepted; raises
ImpossibleError if there is none."""


def constant_change(acceptance: Acceptance, joint: Joint, load: Load) -> FloatArray:
    """Return the smallest constant addition to the stiffness, (samples,)."""
    return np.full(len(load.time), smallest_offset(acceptance, joint, load))


def least_change(acceptance: Acceptance, joint: Joint, load: Load) -> FloatArray:
    """Return the smallest addition at each sample separately, a lower bound for every smooth profile."""
    low, high = checked_range(acceptance, joint, load)
    if np.any(low > high):
        raise ImpossibleError(f"attainable range and limits leave {joint.name} no stiffness")
    asked = load.command.commanded["stiffness"]
    change: FloatArray = np.clip(0.0, low - asked, high - asked)
    return change


@dataclass(frozen=True, eq=False)
class Combination:
    """Changes that together fix a motion.

    Attributes:
        factor: factor of the slow-down, at least 1.
        changes: additions to the stiffness, (samples,), by joint index; joints without one are left out.
        branches: new branches, by joint index; joints that keep theirs are left out.
        size: total cost of the changes.
    """

    factor: float
    changes: Mapping[int, FloatArray]
    branches: Mapping[int, str]
    size: float

    @property
    def constants(self) -> dict[int, float]:
        """Constant additions to the stiffness, by joint index; valid only if the changes are constant."""
        return {index: float(change[0]) for index, change in self.changes.items()}

    def robot(self, robot: Robot) -> Robot:
        """Return a robot with the branches of the combination."""
        return robot.replace({branch_path(robot, index): branch for index, branch in self.branches.items()})


AS_IT_IS = Combination(1.0, {}, {}, 0.0)


def branch_path(robot: Robot, index: int) -> str:
    """Return the path of a joint's branch in the robot file."""
    return f"joints.{index}.actuator.{robot.joints[index].actuator.branch_field}"


_Found = TypeVar("_Found")

REFUSED = ("infeasible", "singular", "over_limit")
"""Verdicts that a fix must remove. Unreliable is not among them: no fix makes a recording less uncertain."""

FINER = 10
"""Subdivisions of each sampling interval when a fix is checked between its samples."""

MOST_INSTANTS = 300_000
"""Largest number of instants in this check: the intervals of longer motions get fewer subdivisions."""


@dataclass(frozen=True)
class Task:
    """The motion to be fixed, with the acceptance rule for its samples and the cost of changes.

    Attributes:
        acceptance: acceptance rule, which includes the robot.
        trajectory: commanded motion.
        cost: measure of the size of a fix.
        keeps_rate: whether a recording that is slowed down is sampled at its original rate; otherwise its own
            samples are kept, further apart.
        impossible: numbers of the factors (see `Factors`) at which no change is accepted, by form and whether
            branches may change, with the key None whatever these are; also valid for the same task under a
            stricter rule, which shares them.
    """

    acceptance: Acceptance
    trajectory: Trajectory
    cost: Cost = RELATIVE_CHANGE
    keeps_rate: bool = True
    impossible: dict[tuple[Form, bool] | None, set[int]] = field(
        default_factory=dict, compare=False, repr=False
    )

    def acceptance_with(self, found: Combination) -> Acceptance:
        """Return the acceptance rule for the robot with the branches of a combination."""
        return replace(self.acceptance, robot=found.robot(self.acceptance.robot))

    def with_constants(self, found: Combination) -> Fix:
        """Return the fix by a combination whose changes of stiffness are constant."""
        offsets = tuple(
            Offset(joint.name, found.constants.get(index, 0.0), units.STIFFNESS.unit(joint.type))
            for index, joint in enumerate(self.acceptance.robot.joints)
            if "stiffness" in joint.actuator.commanded
        )
        changed = any(found.constants.values()) and not self._declares_stiffness
        stretched, factor = self._stretched(found.factor, changed=changed)
        raised = with_raised_stiffness(stretched, found.constants)
        declared, factor = self._kept_rate(raised, factor, found)
        return Fix(
            size=found.size,
            robot=found.robot(self.acceptance.robot),
            declared=declared,
            factor=factor,
            asked=self.trajectory,
            slow_down=self._slow_down(found),
            branch=self._branch(found),
            stiffness_offset=StiffnessOffset(offsets) if found.changes else None,
        )

    def with_profiles(self, found: Combination) -> Fix:
        """Return the fix with the slow-down and branches of a combination and the nearest stiffness profiles.

        Raises:
            ImpossibleError: no profile was found for some joint.
        """
        slower, acceptance = self.trajectory.stretched(found.factor), self.acceptance_with(found)
        robot = acceptance.robot
        find = partial(_nearest_profile_or_constant, acceptance, slower)
        changes = for_refused_joints(acceptance, slower, find, found.factor)
        summaries = tuple(_summary(robot.joints[index], change) for index, (_, change) in changes.items())
        stretched, factor = self._stretched(found.factor, changed=bool(changes))
        scale = factor ** np.arange(STIFFNESS.orders)[:, None]
        at_steps = {index: scale * change.rows[:, load.steps] for index, (load, change) in changes.items()}
        declared, factor = self._kept_rate(with_changed_stiffness(stretched, at_steps), factor, found)
        return Fix(
            size=self._size(found.factor, [(load, change.rows[0]) for load, change in changes.values()]),
            robot=robot,
            declared=declared,
            factor=factor,
            asked=self.trajectory,
            slow_down=self._slow_down(found),
            branch=self._branch(found),
            stiffness_profile=StiffnessProfile(summaries) if summaries else None,
        )

    def with_transition(self) -> Fix:
        """Return the fix with the shortest accepted transitions between stiffness levels.

        Raises:
            ImpossibleError: no transition is accepted.
        """
        before, after, longer = smallest_transition(self.acceptance, self.trajectory)
        asked, changed = (
            each.block(0, each.samples).commanded[STIFFNESS.key].T for each in (self.trajectory, longer)
        )
        sizes = [
            self.cost.of_stiffness(old, new - old)
            for old, new in zip(asked, changed, strict=True)
            if not np.isnan(old).any()
        ]
        return Fix(
            size=math.hypot(*sizes),
            robot=self.acceptance.robot,
            declared=longer,
            asked=self.trajectory,
            transition=LongerTransition(before, after),
        )

    @property
    def _declares_stiffness(self) -> bool:
        return isinstance(self.trajectory.commanded[STIFFNESS.key], ClosedForm)

    def _stretched(self, factor: float, *, changed: bool) -> tuple[Trajectory, float]:
        """Return the slower trajectory, and the factor by which it remains to be stretched.

        Args:
            factor: factor of the slow-down.
            changed: whether the stiffness will be given as values at the samples.
        """
        # a recording is stretched after its fit: slower samples could be fitted differently, for example
        # because mains hum would have another frequency; resampled ones with another stiffness have no fit
        resampled = isinstance(self.trajectory.times, ResampledTimes)
        if self.trajectory.estimates and not (changed and resampled):
            return self.trajectory, factor
        return self.trajectory.stretched(factor), 1.0

    def _kept_rate(self, declared: Trajectory, factor: float, found: Combination) -> tuple[Trajectory, float]:
        """Return the declared trajectory at the rate of the task if possible, and its remaining factor."""
        if found.factor == 1 or not self.keeps_rate:
            return declared, factor
        return with_kept_rate(declared, factor, rate_of(self.trajectory))

    def constants(self) -> Combination:
        """Return the smallest constant changes of stiffness that fix the task without other changes.

        Raises:
            ImpossibleError: no constant fixes some joint.
        """
        changes = for_refused_joints(
            self.acceptance,
            self.trajectory,
            lambda joint, load: constant_change(self.acceptance, joint, _counting(load, self.trajectory)),
        )
        size = self._size(
            1.0, [(_counting(load, self.trajectory), change) for load, change in changes.values()]
        )
        return Combination(1.0, {index: change for index, (_, change) in changes.items()}, {}, size)

    def _size(self, factor: float, changes: Iterable[tuple[Load, FloatArray]]) -> float:
        sizes = [
            self.cost.of_stiffness(load.command.commanded["stiffness"], change) for load, change in changes
        ]
        return math.hypot(self.cost.of_factor(factor), *sizes)

    def _slow_down(self, found: Combination) -> SlowDown | None:
        return SlowDown(found.factor, self.trajectory.duration) if found.factor > 1 else None

    def _branch(self, found: Combination) -> OtherBranch | None:
        names = self.acceptance.robot.joint_names
        branches = {names[index]: branch for index, branch in found.branches.items()}
        return OtherBranch(branches) if branches else None

    def falls_short(self, fix: Fix) -> FloatArray | None:
        """Run a fix; return instants at which it misses the margin or a limit, or None if it is confirmed.

        Instants are times since the start of the unchanged task, s: the worst ones in the report of the run,
        also between samples, and those of a grid `FINER` times as fine. None are returned if only the
        self-check fails.
        """
        run = Run(fix.robot, fix.trajectory, min_margin=self.acceptance.min_margin)
        for _ in run:
            pass
        report = run.findings()
        counted = (each for index, each in enumerate(report.joints) if index not in self.acceptance.ignored)
        short = [joint for joint in counted if self._is_short(joint)]
        soft = [worst.time for tool in report.tools for worst in tool.worst.values()]
        refused = self._refused_between(fix)
        if report.self_check.passed and not short and not soft and not refused.size:
            return None
        worst = soft + [time for joint in short for time in (joint.margin_time, *_violation_times(joint))]
        elapsed = (np.array(worst) - fix.trajectory.start) / (1 + fix.longer)
        return np.union1d(elapsed[np.isfinite(elapsed)], refused)

    def _is_short(self, joint: JointReport) -> bool:
        """Return whether a joint has less than the required margin or a verdict of `REFUSED`."""
        return joint.margin < self.acceptance.min_margin or any(map(joint.shows, REFUSED))

    def _refused_between(self, fix: Fix) -> FloatArray:
        """Return up to `WATCHED_STEPS` refused instants between the samples of a fix, s."""
        trajectory, factor = fix.trajectory, 1 + fix.longer
        # the allowance for the noise of a recording is known at samples only; the run checks between them
        if not trajectory.known_between or trajectory.estimates:
            return np.empty(0)
        acceptance = replace(self.acceptance, robot=fix.robot, between=np.empty(0))
        steps = (trajectory.times.block(0, trajectory.samples) - trajectory.start) / factor
        parts = max(1, min(FINER, MOST_INSTANTS // len(steps)))
        elapsed = (steps[:-1, None] + np.diff(steps)[:, None] * np.arange(1, parts) / parts).ravel()
        refused = [
            part[acceptance.refused(TaskSamples.between(trajectory, part, factor)).any(axis=1)]
            for part in np.array_split(elapsed, 1 + len(elapsed) // usual_block(trajectory.joints))
        ]
        found = np.concatenate(refused)
        return found[evenly(len(found), WATCHED_STEPS)]


def _violation_times(joint: JointReport) -> Iterator[float]:
    """Yield the time of the worst violation of each kind at a joint."""
    yield from (worst.time for worst in (*joint.worst.values(), *joint.between.values()))


def for_refused_joints(
    acceptance: Acceptance,
    trajectory: Trajectory,
    find: Callable[[Joint, Load], _Found],
    factor: float = 1.0,
) -> dict[int, tuple[Load, _Found]]:
    """Search for each joint that has a refused sample; return its load and the result, by joint index.

    Args:
        acceptance: acceptance rule, which includes the robot.
        trajectory: motion of the task, or that motion stretched.
        find: search for one joint.
        factor: factor by which the trajectory is stretched.

    Raises:
        ImpossibleError: a search failed; the error has the reason of each such joint.
    """
    refused = np.flatnonzero(acceptance.refused_joints(trajectory, factor)).tolist()
    found: dict[int, tuple[Load, _Found]] = {}
    reasons: list[str] = []
    loads = joint_loads(acceptance.robot, trajectory, refused, factor, acceptance.between)
    for index, load in zip(refused, loads, strict=True):
        try:
            found[index] = load, find(acceptance.robot.joints[index], load)
        except ImpossibleError as error:
            reasons += error.reasons
    if reasons:
        raise ImpossibleError(*reasons)
    return found


def _counting(load: Load, trajectory: Trajectory) -> Load:
    """Return the load at its samples only, if the trajectory is known only there; otherwise all of it."""
    return load if trajectory.known_between else load.at(load.steps)


def _nearest_profile_or_constant(
    acceptance: Acceptance, trajectory: Trajectory, joint: Joint, load: Load
) -> Change:
    """Return the nearest profile, or the smallest constant if that is nearer."""
    try:
        constant = smallest_offset(acceptance, joint, _counting(load, trajectory))
    except ImpossibleError:
        constant = None
    return nearest_change(acceptance, joint, load, constant)


def _summary(joint: Joint, change: Change) -> JointChange:
    largest = int(np.abs(change.rows[0]).argmax())
    return JointChange(
        joint=joint.name,
        largest=float(change.rows[0, largest]),
        time=float(change.time[largest]),
        rms=change.rms,
        unit=units.STIFFNESS.unit(joint.type),
    )
