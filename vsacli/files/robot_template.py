"""A commented robot file to begin with, whose numbers are plausible for links of these sizes."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vsacli.actuators.kinds import example
from vsacli.base import file_formats
from vsacli.base.errors import InputError
from vsacli.base.storage import reporting_temporary_errors, temporary_folder
from vsacli.base.texts import counted, for_yaml
from vsacli.documents import tree
from vsacli.documents.commented import commented_document, three_digits
from vsacli.documents.number import BOOLEANS
from vsacli.documents.record_values import PathIndex
from vsacli.documents.source import Problems
from vsacli.files.device_actuators import DEVICES, OF_DEVICE, check_drives
from vsacli.files.examples import examples, tables_named_in
from vsacli.robot import file as robot_file
from vsacli.robot.model import Robot

Values = dict[str, Any]

TYPES = {"R": "revolute", "P": "prismatic"}
MOST_JOINTS = 100
MOST_SPELLED_OUT = 12
"""Largest number of joints for which an error shows the letters."""

LENGTH, MASS = 0.3, 2.0
"""Length and mass of the first link, m and kg."""

SHORTER, LIGHTER, TAPERED = 0.8, 0.7, 6
"""Length and mass of a link relative to those of the link before it, up to this many links."""

ROBOT_HEAD = (
    "A robot to begin with. Replace the numbers by those of yours, then remove `placeholder`. What stands",
    "commented out is optional and shown with its default. Numbers are SI; expressions such as pi/2 and",
    "90 deg may be written.",
)


_SPRING = "Data sheet: torque over deflection, to which the coefficients are fitted"

SOURCES = {
    "DenavitHartenberg.a": "From the drawing or CAD",
    "Link.mass": "From CAD, or weighed",
    "Link.com": "From CAD, in this frame",
    "Link.inertia": "From CAD, about the center of mass",
    "Joint.damping": "0, or measured: identify finds it",
    "Motor.inertia": "Data sheet of the motor: rotor inertia, with side: shaft",
    "Motor.damping": "Data sheet: torque constant * no-load current / no-load speed",
    "Motor.max_torque": "Data sheet: peak torque of motor or gear, the smaller one",
    "Motor.max_velocity": "Data sheet: maximum speed; 1 rpm is pi/30 rad/s",
    "Motor.gear_ratio": "Data sheet of the gear: reduction",
    "Motor.torque_constant": "Data sheet, or 30/pi divided by the speed constant in rpm/V",
    "Motor.resistance": "Data sheet: terminal resistance",
    "Motor.max_current": "Data sheet: peak current of motor or driver, the smaller one",
    "Motor.max_voltage": "Data sheet of the driver: supply voltage",
    "Antagonistic.spring": _SPRING,
    "Elastic.stiffness": "Data sheet of spring, gear or torque sensor: torsional stiffness",
    "Elastic.spring": _SPRING,
    "Serial.mechanism": "Lengths from the drawing, stiffness from the data sheet of its springs",
    "Limits.position": "From the drawing: mechanical stops",
    "Limits.velocity": "Data sheet of the motor: maximum speed over gear_ratio",
    "Limits.stiffness": "Data sheet of the actuator: stiffness range",
}
"""Source of the value of a field, by `Class.field`."""


class LinkSizes(NamedTuple):
    """Lengths and masses of links, m and kg: none (the usual ones), one for all links, or one for each."""

    lengths: tuple[float, ...] = ()
    masses: tuple[float, ...] = ()

    def of_link(self, index: int) -> tuple[float, float]:
        """Return length and mass of a link; if one is missing, that of a similar link of this size."""
        match self.lengths, self.masses:
            case (), ():
                taper = min(index, TAPERED)
                return LENGTH * SHORTER**taper, MASS * LIGHTER**taper
            case (), masses:
                mass = masses[index % len(masses)]
                return LENGTH * (mass / MASS) ** (1 / 3), mass
            case lengths, ():
                length = lengths[index % len(lengths)]
                return length, MASS * (length / LENGTH) ** 3
        return self.lengths[index % len(self.lengths)], self.masses[index % len(self.masses)]


USUAL_SIZES = LinkSizes()


def robot_template(
    joints: str,
    actuators: str | Sequence[str] = "antagonistic",
    joint_names: Sequence[str] = (),
    name: str = "my-robot",
    sizes: LinkSizes = USUAL_SIZES,
) -> str:
    """Return the text of a robot file.

    Args:
        joints: a letter for each joint from the base to the tip, R (revolute) or P (prismatic).
        actuators: `KIND` or `KIND:MECHANISM` or a word of `DEVICES` of every joint, or of each joint.
        joint_names: name of each joint; by default joint_1, joint_2 and so on.
        name: name of the robot.
        sizes: sizes of the links. With sizes, all axes of revolute joints are horizontal and parallel, and
            the numbers of the actuators, but those of devices, are scaled to the load.

    Raises:
        InputError: there are other letters, none, or too many; or an actuator does not suit its joint.
        StorageError: the disk has no room for a temporary file.
    """
    types = _joint_types(joints)
    actuator_words = [actuators] * len(types) if isinstance(actuators, str) else actuators
    names = joint_names or [f"joint_{number}" for number in range(1, len(types) + 1)]
    joints_to_write = [*zip(names, types, actuator_words, strict=True)]
    values = _robot_values(name, joints_to_write, sizes)
    if sizes != USUAL_SIZES:
        usual = load_template(_robot_document(_robot_values(name, joints_to_write, USUAL_SIZES)))
        scales = _scales_of_numbers(load_template(_robot_document(values)), usual)
        for index, (joint, word) in enumerate(zip(values["joints"], actuator_words, strict=True)):
            if word not in DEVICES:
                scaled = {
                    key: _scale_numbers(joint[key], ("joints", index, key), scales)
                    for key in OF_DEVICE
                    if key in joint
                }
                joint.update(scaled)
    return _robot_document(values)


def _robot_document(values: Values) -> str:
    return commented_document(file_formats.ROBOT, robot_file.RobotFile, values, ROBOT_HEAD, SOURCES)


def _robot_values(name: str, joints: Sequence[tuple[str, str, str]], sizes: LinkSizes) -> Values:
    """Return the values of a robot file; joints are names, types and actuators."""
    planar = sizes != USUAL_SIZES and all(joint_type == TYPES["R"] for _, joint_type, _ in joints)
    first_is_horizontal = planar or [joint_type for _, joint_type, _ in joints] == [TYPES["R"]]
    return {
        "name": name,
        "placeholder": True,
        "gravity": [0, -9.81, 0] if first_is_horizontal else [0, 0, -9.81],
        "joints": [
            _joint_values(joint, sizes.of_link(index), 0 if index or first_is_horizontal else "pi/2")
            for index, joint in enumerate(joints)
        ],
    }


def load_template(text: str) -> Robot:
    """Return the robot of a template."""
    with temporary_folder() as folder:
        path = folder / "starter.yaml"
        with reporting_temporary_errors():
            path.write_text(text, encoding="utf-8")
            for table in tables_named_in(text):
                (folder / table.name).write_bytes(table.read_bytes())
        return robot_file.load_robot(path)


def _scales_of_numbers(robot: Robot, usual: Robot) -> dict[tuple[str | int, ...], float]:
    """Return the factor on each number of the joints by which a chain becomes similar to the usual one.

    Lengths scale with the reach beyond the joint, forces with its load over this reach, times with the root
    of the reach, since gravity is the same; so the scaled robot moves as the usual one does, in this time.
    """
    sizes, usual_sizes = robot.checked.sizes, usual.checked.sizes
    lengths = sizes.levers / usual_sizes.levers
    revolute = [joint.is_revolute for joint in robot.joints]
    forces = sizes.loads / usual_sizes.loads / np.where(revolute, lengths, 1.0)
    scales = {}
    for path, quantity, _, _ in robot.checked.numbers:
        match path:
            case ("joints", PathIndex(index), *inner):
                length, force = float(lengths[index]), float(forces[index])
                scale = _scale_of_unit(quantity.unit(robot.joints[index].type), length, force)
                keys = (step.number if isinstance(step, PathIndex) else step for step in inner)
                scales["joints", index, *keys] = scale
    return scales


def _scale_of_unit(unit: str, length: float, force: float) -> float:
    """Return the scale of a quantity by its unit, such as N m/rad^3; a mass scales as a force."""
    scale_of = {"m": length, "N": force, "kg": force, "s": math.sqrt(length)}
    numerator, _, denominator = unit.partition("/")
    scale = 1.0
    for units, sign in ((numerator, 1), (denominator.strip("()"), -1)):
        for word in units.split():
            symbol, _, exponent = word.partition("^")
            scale *= scale_of.get(symbol, 1.0) ** (sign * float(exponent or 1))
    return scale


def _scale_numbers(
    content: Any, path: tuple[str | int, ...], scales: Mapping[tuple[str | int, ...], float]
) -> Any:
    """Return values with each number scaled by the factor at its path."""
    match content:
        case Mapping():
            return {key: _scale_numbers(entry, (*path, key), scales) for key, entry in content.items()}
        case list() | tuple():
            return [_scale_numbers(entry, (*path, index), scales) for index, entry in enumerate(content)]
        case float() | int() if path in scales and not isinstance(content, bool):
            return three_digits(content * scales[path])
    return content


def _joint_types(letters: str) -> list[str]:
    types = [TYPES.get(letter, "") for letter in letters.upper()]
    if len(types) > MOST_JOINTS:
        raise InputError.one(f"expected at most {MOST_JOINTS} joints, found {len(types)}")
    if not types or not all(types):
        expected = "expected a letter for each joint, R (revolute) or P (prismatic), e.g. RRP for 3 joints"
        number = int(letters) if re.fullmatch("[0-9]{1,3}", letters) else 0
        joints_text = counted(number, "revolute joint")
        hint = (
            f"for {joints_text}: --joints {'R' * number}"
            if 0 < number <= MOST_SPELLED_OUT
            else f"found {letters!r}"
        )
        raise InputError.one(f"{expected}; {hint}")
    return types


def _joint_values(joint: tuple[str, str, str], size: tuple[float, float], alpha: int | str) -> Values:
    """Return a joint by its name, type and actuator, length and mass of its link, and its twist.

    Of the usual sizes, the axis of the first of several joints is vertical, those of all others are
    horizontal, and links get shorter and lighter towards the tip, as those of real arms do: the load of the
    first joints hardly grows with the number of joints, so that springs of one size hold all arms.
    """
    (name, joint_type, actuator), (length, mass) = joint, size
    moment = mass * length * length / 12
    inertia = {"xx": moment * 2 / 15, "yy": moment, "zz": moment}
    link = {
        "mass": three_digits(mass),
        "inertia": {axis: three_digits(component) for axis, component in inertia.items()},
    }
    half_length, travel = three_digits(length / 2), three_digits(length * 2 / 3)
    geometry = _choose_by_type(
        joint_type,
        {"dh": {"a": 2 * half_length, "alpha": alpha}, "link": {**link, "com": [-half_length, 0, 0]}},
        {"dh": {"a": 0, "alpha": alpha, "d": travel}, "link": {**link, "com": [0, 0, -travel / 2]}},
    )
    try:
        drive_values = _drive_values(actuator, joint_type)
    except InputError as error:
        raise InputError.one(f"{name}: {error}") from None
    return {
        "name": for_yaml(name) if name.lower() in (*BOOLEANS, "null") else name,
        "type": joint_type,
        **geometry,
        "damping": _choose_by_type(joint_type, 0.1, 1.0),
        **drive_values,
    }


def _drive_values(actuator: str, joint_type: str) -> Values:
    """Return the keys of a joint for its drive: an example of its kind, or a device with its damping.

    Raises:
        InputError: it does not drive such joints.
    """
    if actuator not in DEVICES:
        return {"actuator": example(actuator, joint_type)}
    check_drives(actuator, joint_type)
    (robot,) = examples([DEVICES[actuator]])
    text = robot.path.read_text(encoding="utf-8")
    document = tree.plain(tree.parse_yaml(text, Problems(str(robot.path))))
    return {key: entry for key, entry in document["joints"][-1].items() if key in OF_DEVICE}


def _choose_by_type(joint_type: str, revolute: Any, prismatic: Any) -> Any:
    return revolute if joint_type == TYPES["R"] else prismatic
