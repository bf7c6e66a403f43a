"""Figures of a robot file, which show the robot before any run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from vsacli.base.outputs import Staged
from vsacli.cli.console import Talk
from vsacli.files.info import render
from vsacli.files.info.robot_info import describe_robot, static_load, static_loads
from vsacli.results.charts.arm_chart import arm_chart
from vsacli.results.charts.robot_charts import actuator_charts
from vsacli.results.pages import robot_page
from vsacli.results.pages.document import source_text
from vsacli.results.plots import FigureFiles, actuators_figure, arm_figure, stiffness_figure
from vsacli.results.plots.figures import Figures, rendered_figure
from vsacli.robot.file import load_robot
from vsacli.robot.model import Robot

ARM, ACTUATORS, STIFFNESS = "arm", "actuators", "stiffness"
"""Names of the figures, whose files are called `<stem>-<name>`."""


FIGURE_CAPTIONS = {
    ARM: "the arm with joints, links and motors",
    ACTUATORS: "torque of the springs over deflection",
    STIFFNESS: "attainable stiffness over torque",
}
"""Figures in words, for readers of a page who do not see them."""


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
    robot = load_robot(path)
    names = _figure_names(robot)
    staged(names, Path(path).stem).save(_robot_figures(robot))
    if names == [ARM]:
        talk.note(f"{path}: no figures of actuators and stiffness: all joints are rigid")


def write_robot_page(path: str, page: Staged) -> None:
    """Write the page of a robot: its figures, its description and its files.

    Raises:
        InputError: the robot cannot be used.
        StorageError: the page cannot be written.
    """
    robot = load_robot(path)
    figures = {
        FIGURE_CAPTIONS[name]: rendered_figure(figure, "svg")
        for name, figure in _robot_figures(robot).items()
    }
    inputs = [source_text(source) for source in robot.sources]
    page.write_text(robot_page(robot, figures, render(describe_robot(robot)), inputs))


def _figure_names(robot: Robot) -> list[str]:
    """Return the names of the figures of a robot; a rigid one has no springs to draw."""
    is_compliant = any(joint.actuator.sprung for joint in robot.joints)
    return [ARM, ACTUATORS, STIFFNESS] if is_compliant else [ARM]


def _robot_figures(robot: Robot) -> Figures:
    figures = {ARM: arm_figure(arm_chart(robot))}
    if _figure_names(robot) != [ARM]:
        charts = actuator_charts(robot, static_loads(static_load(robot)).tolist())
        figures[ACTUATORS] = actuators_figure(charts, robot.name)
        figures[STIFFNESS] = stiffness_figure(charts, robot.name)
    return figures
