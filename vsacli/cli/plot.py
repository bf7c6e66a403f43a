"""`vsacli plot`: figures and pages of results, simulations, studies, recordings and sensitivities."""

from __future__ import annotations

import math
from pathlib import Path

import click

from vsacli.base.outputs import Outputs
from vsacli.cli.command_parts import (
    example,
    overwrite_option,
    words_of,
)
from vsacli.cli.console import Talk, talk_options
from vsacli.cli.figure_options import EVERYTHING, PAGE, DrawnPart, FigurePlace, FigureTarget, figure_options
from vsacli.cli.file_names import FILE
from vsacli.cli.input_errors import file_kind_or_none, naming_kind
from vsacli.cli.option_types import TIME

RECORDED = frozenset({"table", "motor catalog", "trajectory"})
"""Kinds of files whose recorded signals are drawn; the reader of a catalog says what it is."""

DRAWN = ("robot", "trajectory", "result", "simulation", "table of a study", "table")
"""Kinds of files of which figures are drawn, as in `FileKind`."""


@click.command(
    "plot",
    epilog=example("vsacli plot result.h5 -o figures --format pdf"),
)
@click.argument("files", type=FILE, metavar="FILE...", nargs=-1, required=True)
@figure_options(
    "-o",
    "--output",
    purpose="Folder for the figures.",
    default=".",
    pages=True,
)
@click.option(
    "--from",
    "start",
    metavar="SECONDS",
    type=TIME,
    help="First time to draw.",
    show_default="start of the file",
)
@click.option(
    "--to", "end", metavar="SECONDS", type=TIME, help="Last time to draw.", show_default="end of the file"
)
@click.option(
    "--joints",
    metavar="NAMES",
    callback=words_of("shoulder,elbow"),
    help="Draw only the joints with these names, separated by commas, e.g. shoulder,elbow.",
)
@click.option(
    "--variables",
    metavar="NAMES",
    callback=words_of("theta,dtheta"),
    help="Draw one figure for each of these variables instead, separated by commas, e.g. theta,dtheta.",
)
@click.option("--robot", type=FILE, help="Robot of the recording, for joint names.")
@overwrite_option
@talk_options
def plot(
    files: tuple[str, ...],
    figures: FigureTarget,
    start: float | None,
    end: float | None,
    joints: tuple[str, ...] | None,
    variables: tuple[str, ...] | None,
    robot: str | None,
    overwrite: bool,
    talk: Talk,
) -> None:
    """Draw a robot, results, simulations, recordings, studies and sensitivities, or compare several results.

    Each figure is a file <stem>-<figure>: of a result <stem>-motion, <stem>-motor-torque and others, of a
    robot <stem>-arm, <stem>-actuators and <stem>-stiffness, of two or more results <stem>-<stem>-compare. The
    page docs/figures.md lists and explains all of them.

    --format html writes one page <stem>.html for a browser, without network access: the report, zoomable
    plots of every variable, and the robot at the time cursor; for results that fail, the fixes of
    check-feasibility --fixes; for several FILEs, their differences; for studies, margin and cost of each run;
    for a robot its figures and parameters. It requires the package bokeh: pip install bokeh.
    """
    shown = DrawnPart(joints or (), _span(start, end), variables)
    if twice := next((file for file in files if files.count(file) > 1), None):
        raise click.UsageError(f"{twice} is given twice; give each result once")
    inputs = [*files, *filter(None, [robot])]
    with naming_kind("FILE", files, DRAWN), Outputs(overwrite=overwrite, inputs=inputs) as outputs:
        target = FigurePlace(figures, outputs)
        kinds = set(map(file_kind_or_none, files))
        if "robot" in kinds:
            from vsacli.cli.plot_robot import draw_robot, write_robot_page

            _check_robot(files, shown, robot)
            if page := figures.page(Path(files[0]).stem, outputs):
                write_robot_page(files[0], page)
            else:
                draw_robot(files[0], target.figures, talk)
        elif kinds & RECORDED:
            from vsacli.cli.plot_recording import draw_recording

            _check_recording(files, shown, figures.file_format)
            draw_recording(files[0], robot, shown.joints, shown.span, target.figures, talk)
        elif robot is not None:
            raise click.UsageError(
                "--robot is only for recordings; leave it out, results contain their robot"
            )
        else:
            from vsacli.cli.plot_computed import draw_computed

            draw_computed([Path(file) for file in files], shown, target, talk)
    talk.wrote(outputs)


def _check_robot(files: tuple[str, ...], shown: DrawnPart, robot: str | None) -> None:
    """Refuse options that do not apply to figures of robots.

    Raises:
        click.UsageError: with the option, or for several files.
    """
    if len(files) > 1:
        raise click.UsageError("robots are drawn one at a time; give one robot file and nothing else")
    if shown != EVERYTHING:
        raise click.UsageError(f"{shown.option} cannot be used with a robot; leave it out")
    if robot is not None:
        raise click.UsageError("--robot is only for recordings; leave it out")


def _check_recording(files: tuple[str, ...], shown: DrawnPart, file_format: str) -> None:
    """Refuse options that do not apply to figures of recordings.

    Raises:
        click.UsageError: with the option, or for several files.
    """
    if len(files) > 1:
        raise click.UsageError(
            "recordings are drawn one at a time; `vsacli compare` compares one with a result"
        )
    if shown.variables is not None or file_format == PAGE:
        option = "--format html" if shown.variables is None else "--variables"
        raise click.UsageError(f"{option} needs a result, which `vsacli invdyn` computes from a recording")


def _span(start: float | None, end: float | None) -> tuple[float, float]:
    """Return the first and the last time to draw.

    Raises:
        click.UsageError: the first time is later than the last.
    """
    span = (-math.inf if start is None else start, math.inf if end is None else end)
    if not span[0] <= span[1]:
        raise click.UsageError(f"--from {span[0]:g} must be before --to {span[1]:g}")
    return span
