"""Figures of a robot file, which show the robot before any run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from vsacli.cli.console import Talk
from vsacli.cli.input_errors import recognized

if TYPE_CHECKING:
    from vsacli.results.plots import FigureFiles

ARM, ACTUATORS, STIFFNESS = "arm", "actuators", "stiffness"
"""Names of the figures, whose files are called `<stem>-<name>`."""


def is_robot(path: str) -> bool:
    """Return whether a file is a robot; False if its kind is unknown."""
    return recognized(path) == "robot"


def draw_robot(path: str, staged: Callable[[list[str], str], FigureFiles], talk: Talk) -> None:
    """Draw the arm of a robot, and torques and attainable stiffness of its compliant joints.

    Args:
        path: robot file.
        staged: callable that stages the files of figures, given their names and the beginning of the file
            names.
        talk: prints a note if there are no compliant joints.

    Raises:
        InputError: the robot cannot be used.
        StorageError: a figure cannot be written.
    """
    from vsacli.files.info.robot_info import load_sizes, static_load
    from vsacli.results.charts.arm_chart import arm_chart
    from vsacli.results.charts.robot_charts import actuator_charts
    from vsacli.results.plots import actuators_figure, arm_figure, stiffness_figure
    from vsacli.robot.file import load_robot

    robot = load_robot(path)
    compliant = any(joint.actuator.sprung for joint in robot.joints)
    figures = staged([ARM, ACTUATORS, STIFFNESS] if compliant else [ARM], Path(path).stem)
    figures.save({ARM: arm_figure(arm_chart(robot))})
    if not compliant:
        talk.note(f"{path}: no figures of actuators and stiffness: all joints are rigid")
        return
    charts = actuator_charts(robot, load_sizes(static_load(robot)).tolist())
    figures.save(
        {
            ACTUATORS: actuators_figure(charts, robot.name),
            STIFFNESS: stiffness_figure(charts, robot.name),
        }
    )
