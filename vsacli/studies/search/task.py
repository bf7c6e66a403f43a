"""A task to be fixed: its acceptance rule, the loads of its joints, and the fixes by each kind of change.

A search yields a `Combination` of changes; `Task` turns it into a `Fix` with a trajectory and a robot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TypeVar

import numpy as np

from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.signals import STIFFNESS
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError
from vsacli.studies.search.changed_motion import (
    rate_of,
    with_changed_stiffness,
    with_kept_rate,
    with_raised_stiffness,
)
from vsacli.studies.search.cutting_planes import (
    FACTOR_SEARCH_SAMPLES,
    FewSamples,
    smallest_offset,
    smallest_transition,
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
    branch_path,
)
from vsacli.studies.search.loads import Load, joint_loads
from vsacli.studies.search.nearest_profile import Change, nearest_change
from vsacli.trajectory.curves import ClosedForm
from vsacli.trajectory.times import ResampledTimes
from vsacli.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Combination:
    """Changes that together fix a motion.

    Attributes:
        factor: factor of the slow-down, at least 1.
        constants: constant additions to the stiffness, N m/rad (N/m) by joint index; joints without one are
            left out.
        branches: new branches, by joint index; joints that keep theirs are left out.
        size: root of the sum of the squares of the growth of the duration, relative to the duration, and for
            each joint of `Task.relative_size`.
    """

    factor: float
    constants: Mapping[int, float]
    branches: Mapping[int, str]
    size: float

    def robot(self, robot: Robot) -> Robot:
        """Return a robot with the branches of the combination."""
        return robot.replace({branch_path(robot, index): branch for index, branch in self.branches.items()})


AS_IT_IS = Combination(1.0, {}, {}, 0.0)


_Change = TypeVar("_Change")


@dataclass(frozen=True)
class Task:
    """The motion to be fixed, with the acceptance rule for its samples.

    Attributes:
        acceptance: acceptance rule, which includes the robot.
        trajectory: commanded motion.
        keeps_rate: whether a recording that is slowed down is sampled at its original rate; otherwise its own
            samples are kept, further apart.
        impossible: see `FewSamples`; shared with the same task under a stricter rule.
    """

    acceptance: Acceptance
    trajectory: Trajectory
    keeps_rate: bool = True
    impossible: set[tuple[int, str, float]] = field(default_factory=set, compare=False, repr=False)

    @cached_property
    def few_samples(self) -> FewSamples:
        """Samples with which searches begin."""
        samples = self.acceptance.watched(self.trajectory, FACTOR_SEARCH_SAMPLES)
        return FewSamples(self.acceptance, samples, self.impossible)

    @cached_property
    def refused_loads(self) -> dict[int, Load]:
        """Loads of the joints that are refused as commanded, by index, see `_refused_loads`."""
        return self._refused_loads(AS_IT_IS)

    def _refused_loads(self, combination: Combination) -> dict[int, Load]:
        """Return the loads, at samples and between, of joints that a slow-down and branches do not fix."""
        acceptance, factor = self.acceptance_with(combination), combination.factor
        stretched = self.trajectory if factor == 1 else self.trajectory.stretched(factor)
        loads = joint_loads(acceptance.robot, stretched, acceptance.counted, factor, acceptance.between)
        return {
            index: load
            for index, load in zip(acceptance.counted, loads, strict=True)
            if acceptance.refused_steps(acceptance.robot.joints[index], self.judged(load)).any()
        }

    def judged(self, load: Load) -> Load:
        """Return the load at its samples only, if the trajectory is known only there; otherwise all of it."""
        return load if self.trajectory.known_between else load.at(load.steps)

    @cached_property
    def _stiffness_rms(self) -> FloatArray:
        stiffness = self.trajectory.block(0, self.trajectory.samples).commanded[STIFFNESS.key]
        return np.asarray(np.sqrt(np.mean(stiffness**2, axis=0)))

    def relative_size(self, index: int, change: FloatArray) -> FloatArray:
        """Return the rms of additions to the stiffness of a joint, (..., samples), over its rms stiffness."""
        return np.asarray(np.sqrt(np.mean(change**2, axis=-1)) / self._stiffness_rms[index])

    def acceptance_with(self, combination: Combination) -> Acceptance:
        """Return the acceptance rule for the robot with the branches of a combination."""
        return replace(self.acceptance, robot=combination.robot(self.acceptance.robot))

    def with_constants(self, combination: Combination) -> Fix:
        """Return the fix by a combination whose changes of stiffness are constant."""
        offsets = tuple(
            Offset(joint.name, combination.constants.get(index, 0.0), units.STIFFNESS.unit(joint.type))
            for index, joint in enumerate(self.acceptance.robot.joints)
            if "stiffness" in joint.actuator.commanded
        )
        stiffness = self.trajectory.commanded[STIFFNESS.key]
        has_sampled_stiffness = bool(combination.constants) and not isinstance(stiffness, ClosedForm)
        stretched, factor = self._stretched(combination.factor, changed=has_sampled_stiffness)
        changed_trajectory = with_raised_stiffness(stretched, combination.constants)
        declared, factor = self._at_task_rate(changed_trajectory, factor, combination)
        return Fix(
            size=combination.size,
            robot=combination.robot(self.acceptance.robot),
            declared=declared,
            factor=factor,
            asked=self.trajectory,
            slow_down=self._slow_down(combination),
            branch=self._branch(combination),
            stiffness_offset=StiffnessOffset(offsets) if combination.constants else None,
        )

    def with_profiles(self, combination: Combination) -> Fix:
        """Return the fix with the slow-down and branches of a combination and the nearest stiffness profiles.

        Raises:
            ImpossibleError: no profile was found for some joint.
        """
        acceptance = self.acceptance_with(combination)
        loads = self.refused_loads if combination is AS_IT_IS else self._refused_loads(combination)
        changes = _changes_by_joint(
            acceptance, loads, partial(nearest_change, acceptance, judged=self.judged)
        )
        joints = acceptance.robot.joints
        joint_changes = tuple(_joint_change(joints[index], change) for index, change in changes.items())
        stretched, factor = self._stretched(combination.factor, changed=bool(changes))
        derivative_scales = factor ** np.arange(STIFFNESS.orders)[:, None]
        sample_changes = {
            index: derivative_scales * change.rows[:, loads[index].steps] for index, change in changes.items()
        }
        declared, factor = self._at_task_rate(
            with_changed_stiffness(stretched, sample_changes), factor, combination
        )
        sizes = (change.rms / self._stiffness_rms[index] for index, change in changes.items())
        return Fix(
            size=math.hypot(combination.factor - 1, *sizes),
            robot=acceptance.robot,
            declared=declared,
            factor=factor,
            asked=self.trajectory,
            slow_down=self._slow_down(combination),
            branch=self._branch(combination),
            stiffness_profile=StiffnessProfile(joint_changes) if joint_changes else None,
        )

    def with_transition(self) -> Fix:
        """Return the fix with the shortest accepted transitions between stiffness levels.

        Raises:
            ImpossibleError: no transition is accepted.
        """
        commanded_time, transition_time, changed_trajectory = smallest_transition(
            self.acceptance, self.trajectory
        )
        commanded_stiffness, changed_stiffness = (
            each.block(0, each.samples).commanded[STIFFNESS.key].T
            for each in (self.trajectory, changed_trajectory)
        )
        changes = [
            np.nan_to_num(changed_row - commanded_row)
            for commanded_row, changed_row in zip(commanded_stiffness, changed_stiffness, strict=True)
        ]
        sizes = [float(self.relative_size(i, change)) for i, change in enumerate(changes) if change.any()]
        return Fix(
            size=math.hypot(*sizes),
            robot=self.acceptance.robot,
            declared=changed_trajectory,
            asked=self.trajectory,
            transition=LongerTransition(commanded_time, transition_time),
        )

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

    def _at_task_rate(
        self, declared: Trajectory, factor: float, combination: Combination
    ) -> tuple[Trajectory, float]:
        """Return the declared trajectory at the rate of the task if possible, and its remaining factor."""
        if combination.factor == 1 or not self.keeps_rate:
            return declared, factor
        return with_kept_rate(declared, factor, rate_of(self.trajectory))

    def constants(self) -> Combination:
        """Return the smallest constant changes of stiffness that fix the task without other changes.

        Raises:
            ImpossibleError: no constant fixes some joint.
        """
        loads = {index: self.judged(load) for index, load in self.refused_loads.items()}
        constants = _changes_by_joint(self.acceptance, loads, partial(smallest_offset, self.acceptance))
        sizes = [
            float(self.relative_size(index, np.array([constant]))) for index, constant in constants.items()
        ]
        return Combination(1.0, constants, {}, math.hypot(*sizes))

    def _slow_down(self, combination: Combination) -> SlowDown | None:
        return SlowDown(combination.factor, self.trajectory.duration) if combination.factor > 1 else None

    def _branch(self, combination: Combination) -> OtherBranch | None:
        names = self.acceptance.robot.joint_names
        branches = {names[index]: branch for index, branch in combination.branches.items()}
        return OtherBranch(branches) if branches else None


def _changes_by_joint(
    acceptance: Acceptance, loads: Mapping[int, Load], search: Callable[[Joint, Load], _Change]
) -> dict[int, _Change]:
    """Search for the change of each joint with a load, by index.

    Raises:
        ImpossibleError: a search failed; the error has the reason of each such joint.
    """
    changes: dict[int, _Change] = {}
    reasons: list[str] = []
    for index, load in loads.items():
        try:
            changes[index] = search(acceptance.robot.joints[index], load)
        except ImpossibleError as error:
            reasons += error.reasons
    if reasons:
        raise ImpossibleError(*reasons)
    return changes


def _joint_change(joint: Joint, change: Change) -> JointChange:
    largest_index = int(np.abs(change.rows[0]).argmax())
    return JointChange(
        joint=joint.name,
        largest=float(change.rows[0, largest_index]),
        time=float(change.time[largest_index]),
        rms=change.rms,
        unit=units.STIFFNESS.unit(joint.type),
    )
