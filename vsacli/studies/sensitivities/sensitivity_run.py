"""Derivatives of a run by the numbers of its robot, block by block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from vsacli.dynamics.internal_motion import refuse_damped_transmissions
from vsacli.dynamics.inverse import command_of, compute_block, fitted
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, parameters
from vsacli.studies.sensitivities.drive_derivatives import MARGIN, OF_MOTORS, drive_derivatives
from vsacli.studies.sensitivities.link_derivatives import torque_slopes
from vsacli.studies.sensitivities.slopes import Chained, Derivatives, Group, Known
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

BLOCK_SAMPLES = 4096
"""Steps at a time. 7R, 4000 steps: with 1024 it took half as long again; each block costs the interpreter."""

BLOCK_SLOPES = 10_000_000
"""Bound on numbers times joints times steps at a time, each of 24 bytes at most: 20 joints take 0.6 GB."""

ACTUATOR = "actuator"
"""The part of a joint whose numbers leave the torque that its links demand as it is."""


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
        most = BLOCK_SLOPES // (len(self.parameters) * len(self.robot.joints))
        steps = max(1, min(BLOCK_SAMPLES, most))
        for start in range(0, self.trajectory.samples, steps):
            yield self._derivatives(self.trajectory.block(start, start + steps))

    def _derivatives(self, motion: Motion) -> Derivatives:
        block, joints = compute_block(self.robot, motion), range(len(self.robot.joints))
        groups, by_torques = [], []
        for index in joints:
            own = [place for place, each in enumerate(self.parameters) if _drives(each, index)]
            command = command_of(index, block.arrays())
            derived = drive_derivatives(self.robot, index, command, [self.parameters[at] for at in own])
            by_torques.append(derived.by_torques)
            known = Known(derived.by_numbers)
            groups.append(Group(own, [known if joint == index else None for joint in joints]))
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
