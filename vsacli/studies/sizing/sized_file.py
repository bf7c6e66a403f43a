"""The robot's file with the motors that were chosen."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from vsacli.base.errors import InputError
from vsacli.documents.edited import edited, moved_files
from vsacli.documents.unaliased import unaliased
from vsacli.robot.model import Robot
from vsacli.studies.sizing.motor_sizing import MotorSizing
from vsacli.studies.sizing.sizing_report import Sizing

KEPT = ("max_torque", "max_velocity", "torque_constant", "resistance", "max_current", "max_voltage")
"""Columns of a catalogue that a robot file has by the same name."""


def sized_text(robot: Robot, sizing: Sizing, folder: str | Path) -> str:
    """The text of the robot's file with the best motors in it, where one does.

    Everything else, comments too, stays as the user wrote it. Masses of links stay as they are, and so does a
    coupled inertia on the joint's side; a robot file knows no continuous torque and no efficiency of gears.

    Args:
        robot: as it was read from its file.
        sizing: what was found for it, a motor for each place.
        folder: where the text will stand.

    Raises:
        InputError: the robot was not read from a file.
    """
    source = next(iter(robot.sources), None)
    if source is None or source.text is None:
        raise InputError.one(f"{robot.name}: was not read from a file that could be changed")
    values: dict[str, Any] = {}
    for index, joint in enumerate(robot.joints):
        places = [motor for motor in sizing.motors if motor.joint == joint.name]
        place = f"joints.{index}.actuator"
        motors = [_as_in_robot_file(each) for each in places]
        values[f"{place}.motor"] = motors[0] if len(motors) == 1 else motors
        if joint.actuator.coupled_rotors:
            ratios = math.prod(motor["gear_ratio"] for motor in motors)
            values[f"{place}.coupled_inertia"] = joint.actuator.coupled_rotors / ratios
    files = dict(moved_files(source.text, Path(source.path).parent, Path(folder)))
    return edited(unaliased(source.text, values), {**values, **files})


def _as_in_robot_file(place: MotorSizing) -> dict[str, Any]:
    """The motor that was chosen, with its gear, as `motor:` of an actuator."""
    motor, choice = place.record, place.best
    assert motor is not None, "as of every place"
    assert choice is not None, "likewise"
    found: dict[str, Any] = {"inertia": motor.inertia, "gear_ratio": choice.ratio}
    found |= {name: getattr(motor, name) for name in KEPT if getattr(motor, name) is not None}
    if motor.damping:
        found["damping"] = motor.damping
    if motor.coulomb:
        found["friction"] = {"coulomb": motor.coulomb}
    return found
