"""The page of a robot: the robot with a slider for each joint, its figures, its parameters and its files."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsacli.base.texts import for_terminal, one_line
from vsacli.results.charts.arm_chart import arm_chart, home_position
from vsacli.results.pages.document import InputText, fill_template, package_file
from vsacli.results.pages.packing import arm_values
from vsacli.robot.joint import UNBOUNDED, Joint
from vsacli.robot.model import Robot

TEMPLATE = "robot.html"

SCRIPTS = ("marks.js", "kinematics.js", "robot.js", "poses.js")
"""Scripts of the page, in the order in which they run."""


def robot_page(robot: Robot, figures: Mapping[str, bytes], text: str, inputs: Sequence[InputText]) -> str:
    """Return the page of a robot, as HTML.

    Args:
        robot: the robot.
        figures: figures as SVG, by words for readers who do not see them.
        text: description of the robot, as of `vsacli info`.
        inputs: robot file, and the files that it names.
    """
    arm = arm_values(robot, np.array(robot.gravity), robot.tool_names)
    size = arm_chart(robot).size
    data = {
        "kind": "robot",
        "joints": [_slider(joint, size) for joint in robot.joints],
        "files": [{"troubles": {}, "arm": {**arm, "motion": None}}],
    }
    return fill_template(
        TEMPLATE,
        [package_file(name) for name in SCRIPTS],
        data,
        title=one_line(robot.name),
        figures={words: base64.b64encode(image).decode("ascii") for words, image in figures.items()},
        text="\n".join(map(for_terminal, text.splitlines())),
        inputs=inputs,
    )


def _slider(joint: Joint, size: float) -> dict[str, Any]:
    """Return the values of a joint for `poses.js`.

    A slider ends at the position limits; without them, half a turn, or the size of the arm (m), from home.
    """
    half_range = math.pi if joint.is_revolute else size
    limits = joint.limits.position if joint.limits.position != UNBOUNDED else (-half_range, half_range)
    return {"name": joint.name, "type": joint.type, "home": home_position(joint), "range": limits}
