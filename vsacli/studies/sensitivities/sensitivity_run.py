"""Derivatives of a run by the numbers of its robot, block by block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.variables import MOTORS, Block
from vsacli.dynamics.internal_motion import refuse_damped_transmissions
from vsacli.dynamics.inverse import command_of, compute_block, fitted
from vsacli.robot.model import Robot
from vsacli.studies.sensitivities.drive_derivatives import MARGIN, OF_MOTORS, drive_derivatives
from vsacli.studies.sensitivities.link_derivatives import batches, torque_derivatives
from vsacli.studies.sensitivities.parameters import Parameter, parameters
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

BLOCK_SAMPLES = 4096
"""Steps at a time. 7R, 4000 steps: with 1024 it took half as long again; each block costs the interpreter."""

Slopes = Mapping[str, FloatArray]
"""Derivatives of a joint by variable: (numbers, 2, samples) of its motors, else (numbers, samples)."""


class Group(NamedTuple):
    """Derivatives by some numbers.

    Attributes:
        places: of the numbers, among all.
        of_joints: of each joint; None if nothing of it depends on these numbers.
    """

    places: Sequence[int]
    of_joints: Sequence[Slopes | None]


@dataclass(frozen=True, eq=False)
class Derivatives:
    """What changes with the numbers of a robot over a block of steps, per SI unit of each.

    NaN where the variable does not exist, and where the decoupling matrix is singular.

    Attributes:
        block: the steps, with the variables themselves.
        numbers: how many there are.
        groups: the derivatives; those that are zero for a whole joint are left out.
    """

    block: Block
    numbers: int
    groups: Sequence[Group] = field(repr=False)

    @property
    def time(self) -> FloatArray:
        """Times of the steps, (samples,), s."""
        time: FloatArray = self.block.time
        return time

    @property
    def by_name(self) -> dict[str, FloatArray]:
        """All derivatives by variable: (numbers, samples, joints), of motors with a last axis of 2."""
        joints = self.block.q.shape[1]
        dense = {
            name: np.zeros((self.numbers, joints, *([len(MOTORS)] * of_motors), len(self.time)))
            for name, of_motors in SensitivityRun.slopes.items()
        }
        for group in self.groups:
            for joint, slopes in enumerate(group.of_joints):
                for name, values in ({} if slopes is None else slopes).items():
                    dense[name][group.places, joint] = values
        return {name: np.moveaxis(array, -1, 1) for name, array in dense.items()}


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
        block, joints = compute_block(self.robot, motion), range(len(self.robot.joints))
        groups, by_torques = [], []
        for index in joints:
            own = [place for place, each in enumerate(self.parameters) if _drives(each, index)]
            command = command_of(index, block.arrays())
            derived = drive_derivatives(self.robot, index, command, [self.parameters[at] for at in own])
            by_torques.append(derived.by_torques)
            groups.append(Group(own, [derived.by_numbers if joint == index else None for joint in joints]))
        for places in batches(self.parameters):
            of_torques = torque_derivatives(self.robot, motion, [self.parameters[at] for at in places])
            groups.append(Group(places, list(map(_chained, of_torques, by_torques))))
        return Derivatives(block, len(self.parameters), groups)


def _drives(parameter: Parameter, joint: int) -> bool:
    return parameter.joint == joint and parameter.part == "actuator"


def _chained(of_torques: FloatArray | None, by_torques: Slopes) -> Slopes | None:
    """Derivatives by numbers that the torques (numbers, 3, samples) depend on, from those by the torques."""
    if of_torques is None:
        return None
    return {name: _sum(of_torques, slopes) for name, slopes in by_torques.items()}


def _sum(of_torques: FloatArray, slopes: FloatArray) -> FloatArray:
    """Over tau_e, tau_e', tau_e'': (numbers, 3, samples) times (3, [2,] samples)."""
    spread = of_torques if slopes.ndim == 2 else of_torques[:, :, None]
    total: FloatArray = spread[:, 0] * slopes[0]
    for order in range(1, len(slopes)):
        total += spread[:, order] * slopes[order]
    return total
