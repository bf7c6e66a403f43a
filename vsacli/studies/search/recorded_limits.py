"""The allowance of a search for uncertain recorded signals, equal to that of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np

from vsacli.actuators.reach import VariablesOfJoint
from vsacli.base.arrays import FLAG_TYPE, AnyArray, FlagArray, FloatArray
from vsacli.base.flags import LIMITS
from vsacli.base.signals import STIFFNESS, Signal
from vsacli.base.variables import deviation
from vsacli.dynamics.limits import limit_flags, undecided_samples
from vsacli.dynamics.uncertainty import Deviations, deviations_of_joint, probe_times, times_per_block
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.search.loads import Instants
from vsacli.trajectory.recorded.samples import SampledProfile
from vsacli.trajectory.trajectory import Trajectory

SAME_STIFFNESS = 1e-9
"""Relative difference up to which stiffnesses are equal but for rounding."""

KEPT = 128
"""Sets of deviations that are kept. Successively stricter searches ask for the same ones again and again:
without this, fixes of a recorded 7R beyond a torque limit take 1.25 times as long."""


@dataclass(frozen=True, eq=False)
class RecordedLimits:
    """The allowance for uncertain recorded signals in the check of limits, at any timing and stiffness.

    A run computes standard deviations at probed times and interpolates them linearly. The same times are used
    here, so that search and run agree on every sample; deviations that cannot change the result are skipped.

    Attributes:
        trajectory: unchanged motion of the task.
    """

    trajectory: Trajectory

    def flags(
        self,
        robot: Robot,
        joint: Joint,
        values: VariablesOfJoint,
        instants: Instants,
    ) -> FlagArray:
        """Return the flags of one joint, (samples,), with only the limits that are certainly exceeded.

        Args:
            robot: robot of the task.
            joint: joint of the robot, perhaps on the other branch.
            values: variables of the joint, with `flags` that ignore the uncertainty.
            instants: times of the samples in the task.
        """
        flags: FlagArray = np.array(values["flags"])
        if not self.estimates:
            return flags
        steps = np.flatnonzero(undecided_samples(joint, values))
        if steps.size:
            rows = {name: np.asarray(array)[..., steps] for name, array in values.items()}
            uncertain = self._deviations(robot, joint, rows.get(STIFFNESS.key), instants.at(steps))
            flags[steps] &= ~FLAG_TYPE(LIMITS)
            flags[steps] = limit_flags(joint, {**rows, **uncertain}, flags[steps])
        return flags

    @cached_property
    def estimates(self) -> dict[Signal, SampledProfile]:
        """Signals of the trajectory that were recorded."""
        return self.trajectory.estimates

    @cached_property
    def _probed(self) -> FloatArray:
        return probe_times(self.trajectory)

    @cached_property
    def _known(self) -> Callable[[Robot, int, Joint, bytes], Mapping[str, AnyArray]]:
        """Function `_known_at` of this task, with its latest results."""
        return lru_cache(KEPT)(partial(_known_at, self))

    def _deviations(
        self, robot: Robot, joint: Joint, stiffness: FloatArray | None, instants: Instants
    ) -> dict[str, AnyArray]:
        """Return standard deviations of the variables of a joint, (samples,) or (2, samples), by name.

        They are NaN where the uncertainty cannot be stated.
        """
        elapsed = instants.time - self.trajectory.start
        before = np.clip(np.searchsorted(self._probed, elapsed) - 1, 0, len(self._probed) - 2)
        first, last = self._probed[before], self._probed[before + 1]
        share = (elapsed - first) / (last - first)
        index = robot.joint_names.index(joint.name)
        change = self._change(index, joint, stiffness, instants)
        ends = np.hstack([[time, instants.factor, change] for time in (first, last)])
        probes, places = np.unique(ends, axis=1, return_inverse=True)  # instants between samples share them
        known = self._known(robot, index, joint, probes.tobytes())
        between = {name: np.split(array[..., places], 2, axis=-1) for name, array in known.items()}
        return {name: (1 - share) * begin + share * end for name, (begin, end) in between.items()}

    def _change(
        self, index: int, joint: Joint, stiffness: FloatArray | None, instants: Instants
    ) -> FloatArray:
        """Return the deviation of a joint's stiffness from the command, (samples,), without rounding."""
        if stiffness is None or STIFFNESS.key not in joint.commanded:
            return np.zeros(len(instants.time))
        asked = self.trajectory.at(instants.time).commanded[STIFFNESS.key][:, index]
        return np.where(np.abs(stiffness - asked) > SAME_STIFFNESS * asked, stiffness - asked, 0.0)


def _known_at(
    limits: RecordedLimits, robot: Robot, index: int, joint: Joint, probes: bytes
) -> Mapping[str, AnyArray]:
    """Return the standard deviations of a joint by name, (probes,) or (2, probes).

    Args:
        limits: task with its recorded signals.
        robot: robot of the task.
        index: index of the joint in the robot.
        joint: this joint, perhaps on the other branch.
        probes: for each probe its time since the start of the task, s, the factor of the slow-down, and the
            change of the joint's stiffness; (3, probes).
    """
    joints = (*robot.joints[:index], joint, *robot.joints[index + 1 :])
    changed, rows = replace(robot, joints=joints), np.frombuffer(probes).reshape(3, -1)
    several = times_per_block(robot, limits.estimates)
    parts = [
        _probe(limits, changed, index, *rows[:, start : start + several])
        for start in range(0, rows.shape[1], several)
    ]
    found = Deviations.concatenated(parts, axis=-1)
    return {
        deviation(name): np.where(found.unstated[name][..., None], np.nan, array)
        for name, array in found.deviations.items()
    }


def _probe(
    limits: RecordedLimits,
    robot: Robot,
    index: int,
    elapsed: FloatArray,
    factor: FloatArray,
    change: FloatArray,
) -> Deviations:
    """Return standard deviations of one joint at times of the task, slowed down and with a change."""
    motion = limits.trajectory.at(limits.trajectory.start + elapsed)
    motion = motion.mapped(motion.time, lambda array, order: array / factor[:, None] ** order)
    motion.commanded[STIFFNESS.key][:, index] += change
    covariances = {}
    for signal, estimate in limits.estimates.items():
        covariance = estimate.covariance(elapsed)
        if signal is STIFFNESS:  # with an addition, stiffness is a command and no longer a recording
            covariance[index][..., change != 0] = 0.0
        orders = np.arange(signal.orders)
        covariances[signal] = covariance / factor ** np.add.outer(orders, orders)[..., None]
    return deviations_of_joint(robot, index, motion, limits.estimates, covariances)
