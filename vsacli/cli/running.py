"""What the commands share: reading inputs, protecting them, and showing the report."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsacli.cli.console import Talk
from vsacli.cli.exit_codes import OF_VERDICT, Exit
from vsacli.errors import InputError

if TYPE_CHECKING:
    from vsacli.report import Report
    from vsacli.robot import Robot
    from vsacli.store.reader import StoredResult
    from vsacli.suggest import Suggestions
    from vsacli.trajectory import Trajectory


def load_inputs(robot_path: str, trajectory_path: str, talk: Talk) -> tuple[Robot, Trajectory]:
    """Read and check both files.

    Raises:
        InputError: every problem of the robot, or else of the trajectory.
    """
    from vsacli.robot_file import load_robot
    from vsacli.trajectory_file import load_trajectory

    robot = load_robot(robot_path)
    trajectory = load_trajectory(trajectory_path, robot)
    talk.detail(
        f"{robot.name}: {len(robot.joints)} joints; {trajectory.name}: {trajectory.samples} steps over "
        f"{trajectory.duration:g} s"
    )
    return robot, trajectory


def refuse_input_as_output(output: Path, inputs: Iterable[str | Path]) -> None:
    """Refuse to replace a file that the command reads, which --overwrite alone would allow.

    Raises:
        InputError: `output` is one of the inputs.
    """
    if os.path.exists(output) and any(os.path.samefile(output, path) for path in inputs):
        raise InputError.one("is read by this command; choose another name for its output", output)


def described(result: StoredResult) -> str:
    """A result file in one line, for `--verbose`."""
    names = f"{result.robot_name}, {result.trajectory_name}"
    return f"{result.path}: {names}, {result.samples} steps, {result.verdict}"


def show_report(report: Report, as_json: bool, suggestions: Suggestions | None = None) -> Exit:
    """Print the report, and suggestions if there are; the exit code says what the report says."""
    from vsacli.report_text import render

    if as_json:
        extra = {} if suggestions is None else {"suggestions": suggestions.as_json()}
        click.echo(json.dumps({**report.as_json(), **extra}, indent=1))
    else:
        extra_lines = [] if suggestions is None else suggestions.lines()
        click.echo("\n".join([render(report), *extra_lines]))
    return OF_VERDICT[report.verdict]
