"""A robot file to begin with: plausible numbers of an arm, each to be replaced."""

from __future__ import annotations

from typing import Any

from vsacli.actuators import ACTUATORS
from vsacli.base.errors import InputError
from vsacli.files.templates.commented import document
from vsacli.robot.file import FORMAT, RobotFile

TYPES = {"R": "revolute", "P": "prismatic"}
MOST_JOINTS = 100
HEAD = (
    "A robot to begin with. Replace the numbers by those of yours; what stands commented out is optional",
    "and shown with its default. Numbers are SI; expressions such as pi/2 and 90 deg may be written.",
)

Values = dict[str, Any]


def robot_template(joints: str, actuator: str = "antagonistic", name: str = "my-robot") -> str:
    """The text of a robot file.

    Args:
        joints: a letter for each joint from the base to the tip, R (revolute) or P (prismatic).
        actuator: of every joint, one of `ACTUATORS`.
        name: of the robot.

    Raises:
        InputError: other letters, none, or too many.
    """
    kinds = [TYPES.get(letter, "") for letter in joints.upper()]
    if not all(kinds) or not 0 < len(kinds) <= MOST_JOINTS:
        expected = f"1 to {MOST_JOINTS} letters R (revolute) and P (prismatic), e.g. RRP"
        raise InputError.one(f"joints: expected {expected}, found {joints[:MOST_JOINTS]!r}")
    values = {
        "name": name,
        "gravity": [0, 0, -9.81],
        "joints": [_joint(number, kind, actuator) for number, kind in enumerate(kinds, 1)],
    }
    return document(FORMAT, RobotFile, values, HEAD)


def _joint(number: int, joint_type: str, actuator: str) -> Values:
    """A joint whose axis is vertical if it is the first, otherwise horizontal."""
    alpha: Any = "pi/2" if number == 1 else 0
    link = {"mass": 2.0, "inertia": {"xx": 0.002, "yy": 0.015, "zz": 0.015}}
    geometry = _by_type(
        joint_type,
        {"dh": {"a": 0.3, "alpha": alpha}, "link": {**link, "com": [-0.15, 0, 0]}},
        {"dh": {"a": 0, "alpha": alpha, "d": 0.2}, "link": {**link, "com": [0, 0, -0.1]}},
    )
    return {
        "name": f"joint_{number}",
        "type": joint_type,
        **geometry,
        "damping": _by_type(joint_type, 0.1, 1.0),
        "actuator": {"type": actuator, **ACTUATORS[actuator].example(joint_type)},
    }


def _by_type(joint_type: str, revolute: Any, prismatic: Any) -> Any:
    return revolute if joint_type == TYPES["R"] else prismatic
