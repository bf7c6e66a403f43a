"""Samples of a task, slowed down or stiffened; the load of each joint at these samples, and its periods."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray, IndexArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.base.wrench import WRENCH_NAMES, Wrench
from vsacli.dynamics.inverse import command_of, link_torques_along, usual_block
from vsacli.robot.model import Robot
from vsacli.trajectory.times import stretch
from vsacli.trajectory.trajectory import Motion, Trajectory


class Instants(NamedTuple):
    """Times of samples in the unchanged trajectory of a task.

    Attributes:
        time: times in the unchanged trajectory, (samples,) in s.
        factor: factor of the slow-down at each sample, (samples,).
    """

    time: FloatArray
    factor: FloatArray

    def at(self, steps: IndexArray | slice) -> Instants:
        """Return the instants with the given indices."""
        return Instants(self.time[steps], self.factor[steps])


class TaskSamples(NamedTuple):
    """Some samples of a task, unchanged or changed.

    Attributes:
        motion: motion at the samples, with the times of the unchanged task.
        factor: factor of the slow-down at each sample, (samples,).
    """

    motion: Motion
    factor: FloatArray

    @classmethod
    def of(cls, trajectory: Trajectory, start: int, stop: int, factor: float = 1.0) -> TaskSamples:
        """Return the samples start..stop-1 of a task, or of a task stretched by a factor."""
        motion = trajectory.block(start, stop)
        if factor != 1:
            motion = motion.mapped(_task_times(trajectory, motion.time, factor), lambda array, _: array)
        return cls(motion, np.full(len(motion.time), factor))

    @classmethod
    def between(cls, trajectory: Trajectory, elapsed: FloatArray, factor: float = 1.0) -> TaskSamples:
        """Return instants between the samples of a task, or of a task stretched by a factor.

        Args:
            trajectory: trajectory of the task, stretched if `factor` is not 1.
            elapsed: times since the start of the unchanged task, s.
            factor: factor by which the trajectory is stretched.
        """
        motion = motion_between(trajectory, elapsed, factor)
        unstretched = _task_times(trajectory, motion.time, factor)
        return cls(motion.mapped(unstretched, lambda array, _: array), np.full(len(elapsed), factor))

    @property
    def instants(self) -> Instants:
        """Times of the samples in the task."""
        return Instants(self.motion.time, self.factor)

    def slowed(self, factor: float) -> TaskSamples:
        """Return the samples slowed down by a factor; with an infinite factor they are at rest."""
        slower = self.motion.mapped(self.motion.time, lambda array, order: array / factor**order)
        return TaskSamples(slower, self.factor * factor)

    def stiffened(self, change: FloatArray) -> TaskSamples:
        """Return the samples with a constant added to each joint's stiffness, (joints,) N m/rad (N/m)."""
        motion, arrays = self.motion, self.motion.of_joints
        arrays[STIFFNESS.key] = arrays[STIFFNESS.key] + change
        return self._replace(motion=Motion.of(motion.time, arrays, motion.wrench))

    def loads(self, robot: Robot) -> list[Load]:
        """Return the load of each joint of a robot."""
        motion = self.motion
        commanded = {**motion.variables(), **link_torques_along(robot, motion)}
        commands = (command_of(index, commanded) for index in range(len(robot.joints)))
        return [Load(motion.time, command, self.instants) for command in commands]

    def select(self, steps: IndexArray) -> TaskSamples:
        """Return the samples with the given indices."""
        motion = self.motion.mapped(self.motion.time[steps], lambda array, _: array[steps])
        return TaskSamples(motion, self.factor[steps])


def motion_between(trajectory: Trajectory, elapsed: FloatArray, factor: float = 1.0) -> Motion:
    """Return the motion at the instants of `TaskSamples.between`, with the times of the given trajectory."""
    return trajectory.at(np.clip(trajectory.start + factor * elapsed, *trajectory.times.span))


def evenly_spaced_samples(trajectory: Trajectory, steps: int) -> TaskSamples:
    """Return at most this many samples of a trajectory, both ends included."""
    indices = evenly(trajectory.samples, steps)
    block_samples = usual_block(trajectory.joints)
    return concatenate_task_samples(
        TaskSamples.of(trajectory, start, start + block_samples).select(block_indices - start)
        for start in range(0, trajectory.samples, block_samples)
        if (block_indices := indices[(start <= indices) & (indices < start + block_samples)]).size
    )


def concatenate_task_samples(parts: Iterable[TaskSamples]) -> TaskSamples:
    """Return the samples of several parts, concatenated."""
    motions, factors = zip(*parts, strict=True)
    variables = [motion.variables() for motion in motions]
    arrays = {name: np.concatenate([each[name] for each in variables]) for name in variables[0]}
    last_wrench = motions[-1].wrench
    wrench = last_wrench and Wrench(*(arrays[name] for name in WRENCH_NAMES), frame=last_wrench.frame)
    return TaskSamples(Motion.of(arrays["time"], arrays, wrench), np.concatenate(factors))


@dataclass(frozen=True, eq=False)
class Load:
    """The command of one joint, with its elastic torque, over time.

    Attributes:
        time: ascending times, (samples,) in s, of the task or of the stretched task.
        command: command at these times, rows of (samples,).
        instants: the same times in the unchanged task.
        steps: indices of the times that are samples of the trajectory; the others lie between samples.
    """

    time: FloatArray
    command: Command
    instants: Instants
    steps: IndexArray | slice = field(default_factory=lambda: slice(None))

    @classmethod
    def over(cls, trajectory: Trajectory, factor: float, time: FloatArray, command: Command) -> Load:
        """Return a load at times of a stretched task, which include the samples."""
        task_times = _task_times(trajectory, time, factor)
        steps = np.searchsorted(time, trajectory.times.block(0, trajectory.samples))
        return cls(time, command, Instants(task_times, np.full(len(time), factor)), steps)

    def at(self, steps: IndexArray | slice) -> Load:
        """Return the load at the times with the given indices."""
        rows = {name: row[steps] for name, row in self.command.arrays().items()}
        return Load(self.time[steps], Command.of(rows), self.instants.at(steps))

    def changed(self, stiffness: FloatArray | float, *rates: FloatArray) -> Load:
        """Return the load with an addition to the stiffness and, if given, to its first two derivatives."""
        commanded = dict(self.command.commanded)
        for name, change in zip(STIFFNESS.names, (stiffness, *rates), strict=False):
            commanded[name] = commanded[name] + change
        return replace(self, command=self.command._replace(commanded=commanded))


def joint_loads(
    robot: Robot,
    trajectory: Trajectory,
    joints: list[int],
    factor: float = 1.0,
    between: FloatArray | None = None,
) -> list[Load]:
    """Return the loads of some joints at every sample and midway between samples.

    Every second instant, from the first on, is a sample, unless there are further instants.

    Args:
        robot: robot that executes the motion.
        trajectory: trajectory of the task, stretched if `factor` is not 1.
        joints: indices of the joints.
        factor: factor by which the trajectory is stretched.
        between: further instants, as times since the start of the unchanged task, s.
    """
    instant_count = 2 * trajectory.samples - 1
    names = Command.names(trajectory.commanded)
    time, rows = np.empty(instant_count), np.empty((len(joints), len(names), instant_count))
    block_samples = usual_block(len(robot.joints))
    for start in range(0, trajectory.samples, block_samples):
        steps = trajectory.block(start, start + block_samples + 1)
        midpoints = trajectory.at((steps.time[:-1] + steps.time[1:]) / 2)
        for motion, first in ((steps, 2 * start), (midpoints, 2 * start + 1)):
            instant_slice = slice(first, first + 2 * len(motion.time), 2)
            time[instant_slice], rows[:, :, instant_slice] = (
                motion.time,
                _command_rows(robot, motion, joints, names),
            )
    if between is not None and between.size:
        motion = motion_between(trajectory, between, factor)
        time, chosen = np.unique(np.concatenate([time, motion.time]), return_index=True)
        rows = np.concatenate([rows, _command_rows(robot, motion, joints, names)], axis=2)[:, :, chosen]
    commands = (Command.of(dict(zip(names, of_joint, strict=True))) for of_joint in rows)
    return [Load.over(trajectory, factor, time, command) for command in commands]


def _command_rows(robot: Robot, motion: Motion, joints: list[int], names: tuple[str, ...]) -> FloatArray:
    """Return commands of joints along a motion, with elastic torques, (joints, names, instants)."""
    if not (joints and len(motion.time)):
        return np.empty((len(joints), len(names), len(motion.time)))
    commanded = {**motion.variables(), **link_torques_along(robot, motion)}
    return np.stack([[commanded[name][:, joint] for name in names] for joint in joints])


def _task_times(trajectory: Trajectory, time: FloatArray, factor: float) -> FloatArray:
    """Return times of a stretched trajectory as times of the unchanged one."""
    return stretch(time, trajectory.start, 1 / factor)


PERIOD_TOLERANCE = 1e-6
"""Largest difference between periods, relative to the peak of each variable."""

REST_SPEED_SHARE = 1e-9
"""Share of its peak velocity below which a joint is at rest but for rounding."""

LOADING = ("q", "dq", "ddq", "tau_e", "dtau_e", "ddtau_e")
"""Variables that load the motors, apart from the stiffness."""

MIN_PERIOD_SAMPLES = 20
"""Smallest number of samples in a period; faster repetition is not distinguished from noise."""


class Ends(NamedTuple):
    """The conditions at the start and end of a motion.

    Attributes:
        periods: number of equal periods; 0 if the motion is not periodic.
        moving: whether a motion that is not periodic begins, and ends, with nonzero velocity.
    """

    periods: int = 0
    moving: tuple[bool, bool] = (False, False)

    @classmethod
    def of(cls, trajectory: Trajectory, loads: Sequence[Load]) -> Ends:
        """Return the ends of a trajectory; `loads` are those of all joints."""
        moving = _moving_ends(trajectory)
        if not any(moving):
            return cls()
        counts = [periods(load) for load in loads]
        return cls(math.gcd(*counts)) if all(counts) else cls(0, moving)


def rests(trajectory: Trajectory) -> bool:
    """Return whether all joints stand still at both ends of a trajectory."""
    return not any(_moving_ends(trajectory))


def _moving_ends(trajectory: Trajectory) -> tuple[bool, bool]:
    """Return whether any joint moves at the start, and at the end."""
    speeds = np.abs(trajectory.block(0, trajectory.samples).dq)
    first, last = (bool(np.any(row > REST_SPEED_SHARE * speeds.max(axis=0))) for row in speeds[[0, -1]])
    return first, last


def periods(load: Load) -> int:
    """Return the number of equal periods of a load, each of whole samples; 0 if it is not periodic.

    Every second instant of the load must be a sample.
    """
    arrays = load.command.arrays()
    rows = np.stack([arrays[name] for name in LOADING])
    tolerance = PERIOD_TOLERANCE * np.abs(rows).max(axis=1, keepdims=True)
    intervals = rows.shape[1] // 2
    for count in range(max(intervals // MIN_PERIOD_SAMPLES, 1), 0, -1):
        period_intervals, remainder = divmod(intervals, count)
        if not remainder and np.all(
            np.abs(rows[:, 2 * period_intervals :] - rows[:, : -2 * period_intervals]) <= tolerance
        ):
            return count
    return 0
