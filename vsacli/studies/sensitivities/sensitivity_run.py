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
from vsacli.studies.sensitivities.link_derivatives import torque_slopes
from vsacli.studies.sensitivities.parameters import Parameter, parameters
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

BLOCK_SAMPLES = 4096
"""Steps at a time. 7R, 4000 steps: with 1024 it took half as long again; each block costs the interpreter."""

ACTUATOR = "actuator"
"""The part of a joint whose numbers leave the torque that its links demand as it is."""

Slopes = Mapping[str, FloatArray]
"""Derivatives of a joint by variable: (numbers, 2, samples) of its motors, else (numbers, samples)."""


class Chained(Slopes):
    """Derivatives by numbers that tau_e depends on, by the chain rule when one is asked for.

    Args:
        of_torques: of tau_e, tau_e', tau_e'' by the numbers, (numbers, 3, samples).
        by_torques: of each variable by the three, (3, [2,] samples).
    """

    def __init__(self, of_torques: FloatArray, by_torques: Slopes) -> None:
        self._of_torques, self._by_torques = of_torques, by_torques

    def __getitem__(self, name: str) -> FloatArray:
        by_torques = self._by_torques[name]
        spread = self._of_torques if by_torques.ndim == 2 else self._of_torques[:, :, None]
        total: FloatArray = spread[:, 0] * by_torques[0]
        for order in range(1, len(by_torques)):
            if by_torques[order].any():
                total += spread[:, order] * by_torques[order]
        return total

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_torques)

    def __len__(self) -> int:
        return len(self._by_torques)


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
        of_links = [place for place, each in enumerate(self.parameters) if each.part != ACTUATOR]
        chosen = [self.parameters[at] for at in of_links]
        for places, of_torques in torque_slopes(self.robot, motion, chosen):
            of_joints = [
                None if each is None else Chained(each, slopes)
                for each, slopes in zip(of_torques, by_torques, strict=True)
            ]
            groups.append(Group([of_links[at] for at in places], of_joints))
        return Derivatives(block, len(self.parameters), groups)


def _drives(parameter: Parameter, joint: int) -> bool:
    return parameter.joint == joint and parameter.part == ACTUATOR
