"""What the joints carry along a trajectory, whatever their stiffness."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray
from vsacli.dynamics.inverse import command_of, elastic_torques, usual_block
from vsacli.robot.model import Robot
from vsacli.trajectory.curves import STIFFNESS
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

IndexArray: TypeAlias = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Load:
    """What one joint is asked to do, and its elastic torque.

    Attributes:
        time: ascending, (instants,) in s.
        command: rows (instants,).
    """

    time: FloatArray
    command: Command

    def at(self, instants: IndexArray | slice) -> Load:
        """Some of the instants."""
        return Load(self.time[instants], Command(*(row[instants] for row in self.command)))

    def changed(self, stiffness: FloatArray | float, *rates: FloatArray) -> Load:
        """The same with something added to the stiffness and, if given, to its rate and second derivative."""
        changes = dict(zip(STIFFNESS.names, (stiffness, *rates), strict=False))
        sums = {name: getattr(self.command, name) + change for name, change in changes.items()}
        return replace(self, command=self.command._replace(**sums))


def joint_loads(robot: Robot, trajectory: Trajectory, joints: list[int]) -> list[Load]:
    """The loads of some joints, given by index: at every step, and half-way from one to the next.

    Every second instant, from the first on, is a step.
    """
    instants = 2 * trajectory.samples - 1
    time, rows = np.empty(instants), np.empty((len(joints), len(Command._fields), instants))
    samples = usual_block(len(robot.joints))
    for start in range(0, trajectory.samples, samples):
        steps = trajectory.block(start, start + samples + 1)
        middles = trajectory.at((steps.time[:-1] + steps.time[1:]) / 2)
        for motion, first in ((steps, 2 * start), (middles, 2 * start + 1)):
            _fill(robot, motion, joints, time[first:], rows[:, :, first:])
    return [Load(time, Command(*of_joint)) for of_joint in rows]


def evenly(length: int, count: int) -> IndexArray:
    """At most `count` indices of `length`, evenly chosen, both ends included."""
    return np.linspace(0, length - 1, min(length, count)).round().astype(np.intp)


def _fill(robot: Robot, motion: Motion, joints: list[int], time: FloatArray, rows: FloatArray) -> None:
    """Enter a motion at every second instant."""
    if not len(motion.time):
        return
    places = slice(0, 2 * len(motion.time), 2)
    commanded = {**motion.variables(), **elastic_torques(robot, motion)}
    time[places] = motion.time
    for row, joint in zip(rows, joints, strict=True):
        row[:, places] = np.stack(command_of(joint, commanded))
