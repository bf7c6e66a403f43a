"""Limits along a recorded motion, judged as a run judges them: beyond what the record leaves uncertain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vsacli.actuators.limit_check import OfJoint
from vsacli.base.arrays import AnyArray, FlagArray, FloatArray, of_joint
from vsacli.base.flags import LIMITS
from vsacli.base.signals import STIFFNESS, Signal
from vsacli.base.variables import deviation
from vsacli.dynamics.limits import limit_flags, open_steps
from vsacli.dynamics.uncertainty import deviations, probed_times
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.remedies.motions import Instants
from vsacli.trajectory.recorded.samples import SampledProfile
from vsacli.trajectory.trajectory import Trajectory

SAME_STIFFNESS = 1e-9
"""Relative difference of stiffnesses that may be rounding."""


@dataclass(frozen=True, eq=False)
class RecordedLimits:
    """What the recorded signals of a task leave uncertain of limits, however slow and stiff it becomes.

    A run computes deviations at some times and is linear in between; here the same times count, so that both
    say the same of a step. They are computed only where the answer depends on them.

    Attributes:
        trajectory: the task as it is.
    """

    trajectory: Trajectory

    def flags(self, robot: Robot, joint: Joint, values: OfJoint, instants: Instants) -> FlagArray:
        """The flags of steps of one joint, (samples,), with the limits that are certainly exceeded.

        Args:
            robot: the robot.
            joint: of it, perhaps with another preload.
            values: variables of the joint, among them `flags` with all limits that seem to be exceeded.
            instants: where the steps stand in the task.
        """
        flags: FlagArray = np.array(values["flags"])
        if not self._estimates:
            return flags
        steps = np.flatnonzero(open_steps(joint, values))
        if steps.size:
            rows = {name: np.asarray(array)[..., steps] for name, array in values.items()}
            uncertain = self._deviations(robot, joint, rows.get(STIFFNESS.key), instants.at(steps))
            flags[steps] &= ~np.uint16(LIMITS)
            flags[steps] = limit_flags(joint, {**rows, **uncertain}, flags[steps])
        return flags

    @cached_property
    def _estimates(self) -> dict[Signal, SampledProfile]:
        return self.trajectory.estimates

    @cached_property
    def _probed(self) -> FloatArray:
        return probed_times(self.trajectory)

    def _deviations(
        self, robot: Robot, joint: Joint, stiffness: FloatArray | None, instants: Instants
    ) -> dict[str, AnyArray]:
        """Standard deviations of the variables of a joint by name, (samples,) or (2, samples).

        NaN where none may be stated.
        """
        elapsed = instants.time - self.trajectory.start
        before = np.clip(np.searchsorted(self._probed, elapsed) - 1, 0, len(self._probed) - 2)
        first, last = self._probed[before], self._probed[before + 1]
        share = (elapsed - first) / (last - first)
        index = robot.joint_names.index(joint.name)
        joints = (*robot.joints[:index], joint, *robot.joints[index + 1 :])
        change = self._change(index, joint, stiffness, instants)
        parts = [
            self._probe(replace(robot, joints=joints), index, time, instants.factor, change)
            for time in (first, last)
        ]
        return {name: (1 - share) * parts[0][name] + share * parts[1][name] for name in parts[0]}

    def _change(
        self, index: int, joint: Joint, stiffness: FloatArray | None, instants: Instants
    ) -> FloatArray:
        """What was added to the stiffness of a joint, (samples,)."""
        if stiffness is None or STIFFNESS.key not in joint.commanded:
            return np.zeros(len(instants.time))
        asked = self.trajectory.at(instants.time).commanded[STIFFNESS.key][:, index]
        return np.where(np.abs(stiffness - asked) > SAME_STIFFNESS * asked, stiffness - asked, 0.0)

    def _probe(
        self, robot: Robot, index: int, elapsed: FloatArray, factor: FloatArray, change: FloatArray
    ) -> dict[str, AnyArray]:
        """Deviations of the variables of one joint at times of the task that is passed so slowly."""
        motion = self.trajectory.at(self.trajectory.start + elapsed)
        motion = motion.mapped(motion.time, lambda array, order: array / factor[:, None] ** order)
        motion.commanded[STIFFNESS.key][:, index] += change
        covariances = {}
        for signal, estimate in self._estimates.items():
            covariance = estimate.covariance(elapsed)
            if signal is STIFFNESS:  # what is added makes it a command
                covariance[index][..., change != 0] = 0.0
            orders = np.arange(signal.orders)
            covariances[signal] = covariance / factor ** np.add.outer(orders, orders)[..., None]
        found = deviations(robot, motion, self._estimates, covariances)
        known = {
            deviation(name): np.where(found.unstated[name], np.nan, array)
            for name, array in found.deviations.items()
        }
        return of_joint(known, index)
