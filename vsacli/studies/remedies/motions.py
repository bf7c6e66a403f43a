"""Steps of a task, passed more slowly or with another stiffness: of all joints, and of one with its load."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray, IndexArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.base.wrench import WRENCH_NAMES, Wrench
from vsacli.dynamics.inverse import command_of, elastic_torques, usual_block
from vsacli.robot.model import Robot
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.times import stretch
from vsacli.trajectory.trajectory import Trajectory


class Instants(NamedTuple):
    """Where steps stand in the trajectory that is to be mended.

    Attributes:
        time: of that trajectory as it is, (samples,) in s.
        factor: by which it is passed more slowly there, (samples,).
    """

    time: FloatArray
    factor: FloatArray

    def at(self, steps: IndexArray | slice) -> Instants:
        """Some of them."""
        return Instants(self.time[steps], self.factor[steps])


class Passage(NamedTuple):
    """Some steps of a task, as they are or changed.

    Attributes:
        motion: with the times of the task as it is.
        factor: by which it is passed more slowly, (samples,).
    """

    motion: Motion
    factor: FloatArray

    @classmethod
    def of(cls, trajectory: Trajectory, start: int, stop: int, factor: float = 1.0) -> Passage:
        """The steps start..stop-1 of a task, or of one that was stretched by a factor."""
        motion = trajectory.block(start, stop)
        if factor != 1:
            motion = motion.mapped(_unstretched(trajectory, motion.time, factor), lambda array, _: array)
        return cls(motion, np.full(len(motion.time), factor))

    @classmethod
    def between(cls, trajectory: Trajectory, elapsed: FloatArray, factor: float = 1.0) -> Passage:
        """Instants between the steps of a task, or of one that was stretched by a factor.

        Args:
            trajectory: the task, or the stretched one.
            elapsed: since the start of the task as it is, s.
            factor: of the stretching.
        """
        motion = motion_between(trajectory, elapsed, factor)
        unstretched = _unstretched(trajectory, motion.time, factor)
        return cls(motion.mapped(unstretched, lambda array, _: array), np.full(len(elapsed), factor))

    @property
    def instants(self) -> Instants:
        """Where the steps stand in the task."""
        return Instants(self.motion.time, self.factor)

    def slowed(self, factor: float) -> Passage:
        """The same passed more slowly, at rest if the factor is infinite."""
        slower = self.motion.mapped(self.motion.time, lambda array, order: array / factor**order)
        return Passage(slower, self.factor * factor)

    def stiffened(self, change: FloatArray) -> Passage:
        """With something added to the stiffness of each joint, (joints,) N m/rad (N/m)."""
        motion, arrays = self.motion, self.motion.of_joints
        arrays[STIFFNESS.key] = arrays[STIFFNESS.key] + change
        return self._replace(motion=Motion.of(motion.time, arrays, motion.wrench))

    def loads(self, robot: Robot) -> list[Load]:
        """The load of each joint of a robot."""
        motion = self.motion
        commanded = {**motion.variables(), **elastic_torques(robot, motion)}
        commands = (command_of(index, commanded) for index in range(len(robot.joints)))
        return [Load(motion.time, command, self.instants) for command in commands]

    def select(self, steps: IndexArray) -> Passage:
        """Some of the steps, by index."""
        motion = self.motion.mapped(self.motion.time[steps], lambda array, _: array[steps])
        return Passage(motion, self.factor[steps])


def motion_between(trajectory: Trajectory, elapsed: FloatArray, factor: float = 1.0) -> Motion:
    """The motion at instants, as of `Passage.between`, with the times of the trajectory."""
    return trajectory.at(np.clip(trajectory.start + factor * elapsed, *trajectory.times.span))


def evenly_chosen(trajectory: Trajectory, steps: int) -> Passage:
    """At most so many steps of a trajectory, both ends included."""
    chosen = evenly(trajectory.samples, steps)
    samples = usual_block(trajectory.joints)
    return joined(
        Passage.of(trajectory, start, start + samples).select(inside - start)
        for start in range(0, trajectory.samples, samples)
        if (inside := chosen[(start <= chosen) & (chosen < start + samples)]).size
    )


def joined(passages: Iterable[Passage]) -> Passage:
    """The steps of several passages, one after the other."""
    motions, factors = zip(*passages, strict=True)
    variables = [motion.variables() for motion in motions]
    arrays = {name: np.concatenate([each[name] for each in variables]) for name in variables[0]}
    last = motions[-1].wrench
    wrench = last and Wrench(*(arrays[name] for name in WRENCH_NAMES), frame=last.frame)
    return Passage(Motion.of(arrays["time"], arrays, wrench), np.concatenate(factors))


@dataclass(frozen=True, eq=False)
class Load:
    """What one joint is asked to do, and its elastic torque.

    Attributes:
        time: ascending, (samples,) in s, of the task or of one that was stretched.
        command: rows (samples,).
        instants: where they stand in the task.
        steps: which of the times are steps, by index, where others are among them.
    """

    time: FloatArray
    command: Command
    instants: Instants
    steps: IndexArray | slice = field(default_factory=lambda: slice(None))

    @classmethod
    def over(cls, trajectory: Trajectory, factor: float, time: FloatArray, command: Command) -> Load:
        """At times of a task that was stretched by a factor, the steps among them."""
        unstretched = _unstretched(trajectory, time, factor)
        steps = np.searchsorted(time, trajectory.times.block(0, trajectory.samples))
        return cls(time, command, Instants(unstretched, np.full(len(time), factor)), steps)

    def at(self, steps: IndexArray | slice) -> Load:
        """The load at some of the times."""
        rows = {name: row[steps] for name, row in self.command.arrays().items()}
        return Load(self.time[steps], Command.of(rows), self.instants.at(steps))

    def changed(self, stiffness: FloatArray | float, *rates: FloatArray) -> Load:
        """The load with something added to the stiffness and, if given, to its rate and second derivative."""
        commanded = dict(self.command.commanded)
        for name, change in zip(STIFFNESS.names, (stiffness, *rates), strict=False):
            commanded[name] = commanded[name] + change
        return replace(self, command=self.command._replace(commanded=commanded))


def _unstretched(trajectory: Trajectory, time: FloatArray, factor: float) -> FloatArray:
    """Times of a stretched trajectory as they were before."""
    return stretch(time, trajectory.start, 1 / factor)
