"""A commented study file to begin with, which varies the springs of a robot and the duration of a motion."""

from __future__ import annotations

import re
from typing import Any

from vsacli.base import file_formats
from vsacli.base.texts import for_yaml
from vsacli.documents.commented import commented_document, three_digits
from vsacli.documents.plausibility import ValuesInFile
from vsacli.robot.model import Robot
from vsacli.studies.sweeps.study_file import StudyFile
from vsacli.trajectory.trajectory import Trajectory

STUDY_HEAD = (
    "A study to begin with: each entry of `vary` is a path into robot or trajectory with its values, and all",
    "combinations are computed. What stands commented out is optional and shown with its default.",
)

PLAIN_TEXT = re.compile(r"[A-Za-z./][\w./ -]*")
"""Texts that YAML reads as they are."""

VARIED_SHARE, VARIED_VALUES = 0.2, 5
"""Range about a value in which a study varies it, relative, and the number of values."""


def study_template(robot: Robot, trajectory: Trajectory, robot_path: str, trajectory_path: str) -> str:
    """Return the text of a study file that varies the springs of a robot and the duration of a motion.

    Args:
        robot: robot of the study; one without springs gets the mass of its first link varied.
        trajectory: its motion.
        robot_path: path of the robot file, relative to the study file.
        trajectory_path: path of the trajectory file, likewise.
    """
    path, value = _varied_parameter(robot)
    range_ends = [three_digits(value * (1 + share)) for share in (-VARIED_SHARE, VARIED_SHARE)]
    vary: dict[str, Any] = {path: {"linspace": [*range_ends, VARIED_VALUES]}}
    if trajectory.sources and ValuesInFile(trajectory.sources[0]).has(("duration",)):
        vary["duration"] = [three_digits(trajectory.duration * factor) for factor in (1, 1.5, 2)]
    texts = {"name": f"{robot.name}-{trajectory.name}", "robot": robot_path, "trajectory": trajectory_path}
    quoted = {key: text if PLAIN_TEXT.fullmatch(text) else for_yaml(text) for key, text in texts.items()}
    values = {**quoted, "vary": vary}
    return commented_document(file_formats.STUDY, StudyFile, values, STUDY_HEAD)


def _varied_parameter(robot: Robot) -> tuple[str, float]:
    """Return the path of the first stiffness of a spring, of all joints if it is equal, and its value."""
    spring_numbers = [
        (number.path[2:], number.path[1], number.value)
        for number in robot.checked.numbers
        if number.path[0] == "joints"
        and {"spring", "stiffness", "mechanism"} & {*number.path}
        and number.quantity.revolute.startswith("N")
        and number.value
    ]
    if not spring_numbers:
        return f"joints.{robot.joint_names[0]}.link.mass", robot.joints[0].link.mass
    path_in_joint, joint, value = spring_numbers[0]
    equal_numbers = [each for each in spring_numbers if each[0] == path_in_joint and each[2] == value]
    joint_key = "*" if len(equal_numbers) == len(robot.joints) else str(joint)
    return ".".join(("joints", joint_key, *map(str, path_in_joint))), value
