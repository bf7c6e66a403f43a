"""What the commands share: reading inputs, protecting them, and showing the report."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsacli.base.errors import InputError
from vsacli.cli.console import Talk
from vsacli.cli.exit_codes import OF_VERDICT, Exit

if TYPE_CHECKING:
    from vsacli.analysis.report import Report
    from vsacli.analysis.run import Run
    from vsacli.dynamics.integrated_deflections import IntegratedDeflections
    from vsacli.results.store.reader import StoredResult
    from vsacli.results.store.writer import ResultWriter
    from vsacli.robot.model import Robot
    from vsacli.studies.remedies import Suggestions
    from vsacli.trajectory.trajectory import Trajectory


def load_inputs(robot_path: str, trajectory_path: str, talk: Talk) -> tuple[Robot, Trajectory]:
    """Read and check both files.

    Raises:
        InputError: every problem of the robot, or else of the trajectory.
    """
    from vsacli.robot.file import load_robot
    from vsacli.trajectory.file import load_trajectory

    robot = load_robot(robot_path)
    trajectory = load_trajectory(trajectory_path, robot)
    talk.detail(
        f"{robot.name}: {len(robot.joints)} joints; {trajectory.name}: {trajectory.samples} steps over "
        f"{trajectory.duration:g} s"
    )
    return robot, trajectory


def chosen_deflections(method: str, robot: Robot, trajectory: Trajectory) -> IntegratedDeflections | None:
    """The deflections that a run uses, as `--deflections` says; None if it solves for them at each step."""
    if method == "root":
        return None
    from vsacli.dynamics.integrated_deflections import integrate_deflections

    return integrate_deflections(robot, trajectory)


def compute(run: Run, talk: Talk, writer: ResultWriter | None = None) -> Report:
    """Compute block by block; a writer gets each block as it comes, and the report at the end."""
    for warning in run.choice.warnings:
        talk.note(warning)
    talk.detail(run.choice.reason)
    with writer or nullcontext(), talk.progress(run.trajectory.samples) as progress:
        for block in run:
            if writer is not None:
                writer.write(block)
            progress.update(len(block.time))
        report = run.report()
        if writer is not None:
            writer.finish(report.as_json())
    return report


def refuse_input_as_output(output: Path, inputs: Iterable[str | Path]) -> None:
    """Refuse to replace a file that the command reads, which --overwrite alone would allow.

    Raises:
        InputError: `output` is one of the inputs.
    """
    if os.path.exists(output) and any(os.path.samefile(output, path) for path in inputs):
        raise InputError.one("is read by this command; choose another name for its output", output)


def run_stem(robot_path: str, trajectory_path: str) -> str:
    """What the files of a run are called after, unless the user says otherwise."""
    return f"{Path(robot_path).stem}-{Path(trajectory_path).stem}"


def described(result: StoredResult) -> str:
    """A result file in one line, for `--verbose`."""
    names = f"{result.robot_name}, {result.trajectory_name}"
    return f"{result.path}: {names}, {result.samples} steps, {result.verdict}"


def show_report(report: Report, as_json: bool, suggestions: Suggestions | None = None) -> Exit:
    """Print the report, and suggestions if there are; the exit code says what the report says."""
    if as_json:
        extra = {} if suggestions is None else {"suggestions": suggestions.as_json()}
        click.echo(json.dumps({**report.as_json(), **extra}, indent=1))
    else:
        extra_lines = [] if suggestions is None else suggestions.lines()
        click.echo("\n".join([str(report), *extra_lines]))
    return OF_VERDICT[report.verdict]
