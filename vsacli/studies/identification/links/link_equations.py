"""Equations of links: what the springs carry, or the motor of a rigid joint, is Y pi + damping + friction.

What springs carry follows from recorded positions by their numbers, which the motors told before: their
uncertainty is part of that of the links. A rigid joint has motor and link in one equation.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import FloatArray
from vsacli.compute.duals import tangent_of, value_of
from vsacli.dynamics.drive import motor_torques
from vsacli.dynamics.joint_friction import joint_friction
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, apart, parameters, seeded
from vsacli.studies.identification.estimation.equations import Equations
from vsacli.studies.identification.links.base_parameters import BaseParameters, base_parameters
from vsacli.studies.identification.links.inertial_parameters import all_parameters, names
from vsacli.studies.identification.links.regressor import regressor
from vsacli.studies.identification.motors.motor_equations import joint_motion
from vsacli.studies.identification.motors.unknowns import WIDTH, unknowns
from vsacli.studies.identification.records.signals import Signals

RESISTANCES = ("damping", "friction")
"""Parts of a joint against which its link moves."""


class LinkUnknowns(NamedTuple):
    """What is to be found of links.

    Attributes:
        base: combinations of their inertial parameters.
        numbers: of the robot: damping and friction of joints, and motors of those that are rigid.
        names: of all, base parameters first.
        present: values of all by the robot.
    """

    base: BaseParameters
    numbers: tuple[Parameter, ...]
    names: tuple[str, ...]
    present: FloatArray

    @classmethod
    def of(cls, robot: Robot, fit: Sequence[str]) -> LinkUnknowns:
        """Those of a robot.

        Args:
            robot: the robot.
            fit: words and patterns, as of `unknowns`, of what is to be found of rigid joints' motors.
        """
        base = base_parameters(robot)
        numbers = tuple(each for each in _numbers(robot, fit) if each.path[-1] != WIDTH)
        return cls(
            base=base,
            numbers=numbers,
            names=(*base.names(names(robot)), *map(str, numbers)),
            present=np.concatenate((base.of(all_parameters(robot)), [each.value for each in numbers])),
        )


def _numbers(robot: Robot, fit: Sequence[str]) -> Iterator[Parameter]:
    yield from (each for each in parameters(robot) if each.part in RESISTANCES)
    for index, joint in enumerate(robot.joints):
        if not joint.actuator.sprung:
            yield from unknowns(robot, index, fit)


class Given(NamedTuple):
    """Numbers that were found before.

    Attributes:
        numbers: of the robot.
        errors: what independent errors change of them, (numbers, errors), each by one standard error.
    """

    numbers: tuple[Parameter, ...]
    errors: FloatArray


NOTHING_GIVEN = Given((), np.zeros((0, 0)))


def link_equations(
    robot: Robot, sought: LinkUnknowns, signals: Signals, given: Given = NOTHING_GIVEN
) -> Equations:
    """The equations of all links whose torque is known: by springs and motors, or by a rigid drive.

    Args:
        robot: with the springs that were found.
        sought: the unknowns, by this robot.
        signals: a record.
        given: numbers of springs whose uncertainty counts.
    """
    columns = regressor(robot, signals.q, signals.dq, signals.ddq)[:, sought.base.kept]
    found = []
    for index, joint in enumerate(robot.joints):
        torque, of_given = _carried(robot, index, signals, given.numbers)
        resistance, slopes = _resistance(robot, index, signals, sought.numbers)
        if np.isfinite(torque).all():
            taken = sought.present[: len(sought.base.kept)] @ columns[index] + resistance
            of_joint = np.stack((torque, taken, *columns[index], *slopes, *of_given))
            found.append((f"link of {joint.name}", signals.filter.applied(of_joint.T)))
    together = np.concatenate([rows for _, rows in found])
    last = 2 + len(sought.names)
    return Equations(
        measured=together[:, 0],
        predicted=together[:, 1],
        slopes=together[:, 2:last],
        group=np.repeat([name for name, _ in found], [len(rows) for _, rows in found]),
        sample=np.concatenate([np.arange(len(rows)) for _, rows in found]),
        errors=together[:, last:] @ given.errors,
    )


def _carried(
    robot: Robot, index: int, signals: Signals, given: Sequence[Parameter]
) -> tuple[FloatArray, FloatArray]:
    """Torque that springs or a rigid drive bring to a joint, (samples,), and its slopes by given numbers."""
    actuator = robot.joints[index].actuator
    if not actuator.sprung:
        return signals.tau_motor[:, index, 0], np.zeros((len(given), len(signals.time)))
    own = [each if each.joint == index else None for each in given]
    chosen = [each for each in own if each is not None]
    carrying = apart(seeded(robot, chosen).joints[index]).actuator
    torque = carrying.carried(joint_motion(signals, index)).tau_e
    slopes = np.zeros((len(given), len(signals.time)))
    slopes[[each is not None for each in own]] = tangent_of(torque, len(chosen), signals.time.shape)
    return value_of(torque), slopes


def _resistance(
    robot: Robot, index: int, signals: Signals, numbers: Sequence[Parameter]
) -> tuple[FloatArray, FloatArray]:
    """What damping and friction of a joint and its rigid drive take, (samples,), and slopes by numbers."""
    joint = apart(seeded(robot, numbers).joints[index])
    motion = joint_motion(signals, index)
    dq = motion["dq"]
    torque: Any = joint.damping * dq + joint_friction(joint.friction, (dq, 0, 0, 0)).tau
    if not joint.actuator.sprung:
        dtheta, ddtheta = (np.stack([motion[name]] * SIDES) for name in ("dq", "ddq"))
        torque = torque + motor_torques(joint.actuator, dtheta, ddtheta, np.zeros_like(dtheta))[0]
    return value_of(torque), tangent_of(torque, len(numbers), signals.time.shape)
