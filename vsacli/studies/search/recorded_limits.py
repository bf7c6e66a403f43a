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

CACHE_SIZE = 128
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
        indices = np.flatnonzero(undecided_samples(joint, values))
        if indices.size:
            values_at_indices = {name: np.asarray(array)[..., indices] for name, array in values.items()}
            deviations = self._deviations(
                robot, joint, values_at_indices.get(STIFFNESS.key), instants.at(indices)
            )
            flags[indices] &= ~FLAG_TYPE(LIMITS)
            flags[indices] = limit_flags(joint, {**values_at_indices, **deviations}, flags[indices])
        return flags

    @cached_property
    def estimates(self) -> dict[Signal, SampledProfile]:
        """Signals of the trajectory that were recorded."""
        return self.trajectory.estimates

    @cached_property
    def _probed_times(self) -> FloatArray:
        return probe_times(self.trajectory)

    @cached_property
    def _cached_deviations(self) -> Callable[[Robot, int, Joint, bytes], Mapping[str, AnyArray]]:
        """Function `_probe_deviations` of this task, with its latest results."""
        return lru_cache(CACHE_SIZE)(partial(_probe_deviations, self))

    def _deviations(
        self, robot: Robot, joint: Joint, stiffness: FloatArray | None, instants: Instants
    ) -> dict[str, AnyArray]:
        """Return standard deviations of the variables of a joint, (samples,) or (2, samples), by name.

        They are NaN where the uncertainty cannot be stated.
        """
        elapsed = instants.time - self.trajectory.start
        probe_indices = np.clip(
            np.searchsorted(self._probed_times, elapsed) - 1, 0, len(self._probed_times) - 2
        )
        start_times, end_times = self._probed_times[probe_indices], self._probed_times[probe_indices + 1]
        share = (elapsed - start_times) / (end_times - start_times)
        index = robot.joint_names.index(joint.name)
        change = self._stiffness_change(index, joint, stiffness, instants)
        probe_ends = np.hstack([[time, instants.factor, change] for time in (start_times, end_times)])
        probes, probe_columns = np.unique(
            probe_ends, axis=1, return_inverse=True
        )  # instants between samples share them
        probe_deviations = self._cached_deviations(robot, index, joint, probes.tobytes())
        deviations_at_ends = {
            name: np.split(array[..., probe_columns], 2, axis=-1) for name, array in probe_deviations.items()
        }
        return {name: (1 - share) * begin + share * end for name, (begin, end) in deviations_at_ends.items()}

    def _stiffness_change(
        self, index: int, joint: Joint, stiffness: FloatArray | None, instants: Instants
    ) -> FloatArray:
        """Return the deviation of a joint's stiffness from the command, (samples,), without rounding."""
        if stiffness is None or STIFFNESS.key not in joint.commanded:
            return np.zeros(len(instants.time))
        commanded_stiffness = self.trajectory.at(instants.time).commanded[STIFFNESS.key][:, index]
        return np.where(
            np.abs(stiffness - commanded_stiffness) > SAME_STIFFNESS * commanded_stiffness,
            stiffness - commanded_stiffness,
            0.0,
        )


def _probe_deviations(
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
    changed_robot, probe_rows = replace(robot, joints=joints), np.frombuffer(probes).reshape(3, -1)
    batch_size = times_per_block(robot, limits.estimates)
    batches = [
        _probe(limits, changed_robot, index, *probe_rows[:, start : start + batch_size])
        for start in range(0, probe_rows.shape[1], batch_size)
    ]
    deviations = Deviations.concatenated(batches, axis=-1)
    return {
        deviation(name): np.where(deviations.unstated[name][..., None], np.nan, array)
        for name, array in deviations.deviations.items()
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
