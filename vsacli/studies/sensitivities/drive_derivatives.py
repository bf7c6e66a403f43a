"""Derivatives of what the motors of a joint do, by numbers of its actuator and by the torques of its link."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from vsacli.actuators.reach import margin
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import NEAR_SINGULAR_MARGIN
from vsacli.compute.duals import seeds, tangent_of
from vsacli.dynamics.drive import driven_by
from vsacli.dynamics.elastic_torques import TORQUES
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, apart, seeded
from vsacli.studies.sensitivities.implicit import ImplicitSolution

OF_MOTORS = ("tau_motor", "theta", "motor_power")
"""Variables of the motors that are differentiated."""

SPEED = "dtheta"
"""Variable that says where dry friction reverses; differentiated as well."""

MARGIN = "margin"
"""Of the stiffness to the nearer end of its corridor, relative."""


class DriveDerivatives(NamedTuple):
    """Derivatives of the variables of a joint, by name: (..., 2, samples) of its motors, else (..., samples).

    Attributes:
        by_numbers: by the numbers of the actuator, (numbers, ...), per SI unit of each.
        by_torques: by tau_e, tau_e', tau_e'', (3, ...).
    """

    by_numbers: dict[str, FloatArray]
    by_torques: dict[str, FloatArray]


def drive_derivatives(
    robot: Robot, index: int, command: Command, chosen: Sequence[Parameter]
) -> DriveDerivatives:
    """Differentiate (61)-(74) of a joint.

    NaN where the variable does not exist, and where the decoupling matrix is singular.

    Args:
        robot: the robot.
        index: of the joint.
        command: what it is asked to do.
        chosen: numbers of its actuator.
    """
    numbers, motors = len(chosen), 2
    directions = numbers + len(TORQUES) + motors
    carrying = apart(seeded(robot, chosen).joints[index])
    torques: dict[str, Any] = dict(
        zip(TORQUES, seeds([getattr(command, name) for name in TORQUES], numbers), strict=True)
    )
    implicit = ImplicitSolution(robot.joints[index].actuator, carrying.actuator, directions)
    object.__setattr__(carrying.actuator, "solve", implicit.solve)  # in place of a search, which has no slope
    with np.errstate(invalid="ignore", divide="ignore"):
        driven = driven_by(carrying, command._replace(**torques), NEAR_SINGULAR_MARGIN)
        gap = margin(driven.stiffness, driven.stiffness_lower, driven.stiffness_upper)
    found = {name: getattr(driven, name) for name in (*OF_MOTORS, SPEED)} | {MARGIN: gap}
    tangents = {
        name: np.where(np.isnan(each), np.nan, tangent_of(each, directions, np.shape(each)))
        for name, each in found.items()
    }
    return DriveDerivatives(
        {name: tangent[:numbers] for name, tangent in tangents.items()},
        {name: tangent[numbers : numbers + len(TORQUES)] for name, tangent in tangents.items()},
    )
