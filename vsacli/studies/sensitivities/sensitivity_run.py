"""Derivatives of a run by the numbers of its robot, block by block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.variables import Block
from vsacli.dynamics.internal_motion import refuse_damped_transmissions
from vsacli.dynamics.inverse import command_of, compute_block, fitted
from vsacli.robot.model import Robot
from vsacli.studies.sensitivities.drive_derivatives import MARGIN, OF_MOTORS, drive_derivatives
from vsacli.studies.sensitivities.link_derivatives import batches, torque_derivatives
from vsacli.studies.sensitivities.parameters import Parameter, parameters
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

BLOCK_SAMPLES = 1024
"""Steps at a time: tangents of ten numbers then stay in the processor's cache. 7R, 4000 steps: 512 and 2048
took a tenth longer, 4096 a third."""


@dataclass(frozen=True, eq=False)
class Derivatives:
    """What changes with the numbers of a robot over a block of steps, per SI unit of each.

    NaN where the variable does not exist, and where the decoupling matrix is singular.

    Attributes:
        block: the steps, with the variables themselves.
        by_name: derivatives by variable: (parameters, samples, joints), of motors with a last axis of 2.
    """

    block: Block
    by_name: dict[str, FloatArray] = field(repr=False)

    @property
    def time(self) -> FloatArray:
        """Times of the steps, (samples,), s."""
        time: FloatArray = self.block.time
        return time


class SensitivityRun:
    """Iterates over a trajectory.

    Args:
        robot: the robot.
        trajectory: for this robot.
        patterns: only the numbers whose paths fit one of these; all that matter if empty.

    Attributes:
        parameters: the numbers, in the order of the derivatives.
        slopes: names of the variables that are differentiated, each with whether it is one of motors.

    Raises:
        InputError: the trajectory does not fit, a pattern fits no number, or a transmission is damped.
    """

    slopes: ClassVar[Mapping[str, bool]] = {**dict.fromkeys(OF_MOTORS, True), MARGIN: False}

    def __init__(self, robot: Robot, trajectory: Trajectory, patterns: Sequence[str] = ()) -> None:
        self.robot, self.trajectory = robot, fitted(robot, trajectory)
        refuse_damped_transmissions(robot, self.trajectory, "sensitivities")
        self.parameters: tuple[Parameter, ...] = parameters(robot, patterns)

    def __iter__(self) -> Iterator[Derivatives]:
        for start in range(0, self.trajectory.samples, BLOCK_SAMPLES):
            yield self._derivatives(self.trajectory.block(start, start + BLOCK_SAMPLES))

    def _derivatives(self, motion: Motion) -> Derivatives:
        block, joints = compute_block(self.robot, motion), len(self.robot.joints)
        found = {
            name: np.zeros((len(self.parameters), joints, *([2] * of_motors), len(motion.time)))
            for name, of_motors in self.slopes.items()
        }
        by_torques = [self._of_drive(block, index, found) for index in range(joints)]
        for places in batches(self.parameters):
            chosen = [self.parameters[place] for place in places]
            of_torques = torque_derivatives(self.robot, motion, chosen)
            for index, (of_drive, of_torque) in enumerate(zip(by_torques, of_torques, strict=True)):
                if of_torque is None:
                    continue
                for name, slopes in of_drive.items():
                    found[name][places, index] = _chained(of_torque, slopes)
        return Derivatives(block, {name: np.moveaxis(array, -1, 1) for name, array in found.items()})

    def _of_drive(self, block: Block, index: int, found: dict[str, FloatArray]) -> dict[str, FloatArray]:
        """Derivatives by the torques of a link; those by numbers of its actuator are put in their place."""
        own = [place for place, each in enumerate(self.parameters) if _drives(each, index)]
        command = command_of(index, block.arrays())
        derived = drive_derivatives(self.robot, index, command, [self.parameters[place] for place in own])
        for name, slopes in derived.by_numbers.items():
            found[name][own, index] = slopes
        return derived.by_torques


def _drives(parameter: Parameter, joint: int) -> bool:
    return parameter.joint == joint and parameter.part == "actuator"


def _chained(of_torques: FloatArray, by_torques: FloatArray) -> FloatArray:
    """The sum over tau_e, tau_e', tau_e'' of (parameters, 3, samples) times (3, ..., samples)."""
    return np.asarray(np.einsum("pks,k...s->p...s", of_torques, by_torques))
