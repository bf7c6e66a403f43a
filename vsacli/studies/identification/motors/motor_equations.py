"""Equations of motors behind springs: tau_motor = B theta'' + D theta' + friction + U_theta(q, theta).

They are (73)-(74) with what was recorded, and free of the links.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import FloatArray
from vsacli.compute.duals import Dual, tangent_of, value_of
from vsacli.dynamics.drive import motor_torques
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, apart, seeded
from vsacli.studies.identification.estimation.equations import Equations
from vsacli.studies.identification.records.signals import Signals


def motor_equations(
    robot: Robot, index: int, unknowns: Sequence[Parameter], values: FloatArray, signals: Signals
) -> Equations:
    """The equations of the motors of a joint with springs, those whose torque was recorded.

    Args:
        robot: the robot, whose other numbers are taken as they are.
        index: of the joint.
        unknowns: numbers of its actuator.
        values: of these at present, (unknowns,), SI units.
        signals: a record, or the motion of a plan with its torques.
    """
    present = [each._replace(value=float(value)) for each, value in zip(unknowns, values, strict=True)]
    carrying = apart(seeded(robot, present).joints[index]).actuator
    motion = joint_motion(signals, index)
    with np.errstate(all="ignore"):  # numbers far off, from which the search comes back
        torques = predicted_torques(carrying, motion)
    slopes = tangent_of(torques, len(unknowns), np.shape(value_of(torques)))
    measured = signals.tau_motor[:, index].T
    recorded = [motor for motor in range(SIDES) if not np.isnan(measured[motor]).all()]
    columns = [
        signals.filter.applied(np.stack((measured[motor], value_of(torques)[motor], *slopes[:, motor])).T)
        for motor in recorded
    ]
    count = len(columns[0]) if columns else 0
    together = np.concatenate([np.empty((0, 2 + len(unknowns))), *columns])
    names = motor_names(robot, index)
    return Equations(
        measured=together[:, 0],
        predicted=together[:, 1],
        slopes=together[:, 2:],
        group=np.repeat([names[motor] for motor in recorded], count),
        sample=np.tile(np.arange(count), len(recorded)),
    )


def predicted_torques(actuator: Actuator, motion: dict[str, Any]) -> Any:
    """Torques of both motors, (2, samples), from the motion of joint and motors by name; NaN of none."""
    tau_spring = actuator.carried(motion).tau_spring
    missing = np.full((SIDES - len(tau_spring), *tau_spring.shape[1:]), np.nan)
    against = np.concatenate((tau_spring, missing))
    return motor_torques(actuator, motion["dtheta"], motion["ddtheta"], against)


def motor_names(robot: Robot, index: int) -> tuple[str, ...]:
    """What the motors of a joint are called in reports."""
    joint = robot.joints[index]
    if len(joint.actuator.motors) == 1:
        return (f"motor of {joint.name}",)
    return tuple(f"motor {number} of {joint.name}" for number, _ in enumerate(joint.actuator.motors, 1))


def joint_motion(signals: Signals, index: int) -> dict[str, Any]:
    """Motion of a joint and its motors, samples last, as duals that no number of the robot changes.

    Functions of NumPy then take numbers of the robot that are duals.
    """
    return {name: Dual(values, {}) for name, values in _arrays(signals, index).items()}


def _arrays(signals: Signals, index: int) -> dict[str, FloatArray]:
    q, theta = signals.q[:, index], signals.theta[:, index].T
    return {
        "q": q,
        "dq": signals.dq[:, index],
        "ddq": signals.ddq[:, index],
        "theta": theta,
        "phi": theta - q,
        "dtheta": signals.dtheta[:, index].T,
        "ddtheta": signals.ddtheta[:, index].T,
    }
