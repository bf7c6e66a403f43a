"""`vsacli plot`: figures and pages of results, simulations, studies, recordings and sensitivities."""

from __future__ import annotations

import math
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from vsacli.base import file_formats
from vsacli.base.outputs import Outputs
from vsacli.cli.command_parts import (
    example,
    overwrite_option,
    result_line,
    words_of,
)
from vsacli.cli.console import Talk, talk_options
from vsacli.cli.figure_options import PAGE, FigureTarget, figure_options
from vsacli.cli.file_names import FILE
from vsacli.cli.input_errors import naming_kind, naming_option, recognized
from vsacli.cli.option_types import TIME
from vsacli.cli.plot_page import write_page
from vsacli.cli.plot_recording import RECORDED, RECORDING, draw_recording, has_recording, recording_figure
from vsacli.cli.plot_robot import draw_robot, write_robot_page
from vsacli.cli.sensitivity import RANKING
from vsacli.results.charts.ranking import Ranking

if TYPE_CHECKING:
    from collections.abc import Iterable

    from vsacli.base.outputs import Outputs, Staged
    from vsacli.results.plots import FigureFiles
    from vsacli.results.store.reader import StoredResult

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
    help="Draw only these joints, e.g. shoulder,elbow.",
)
@click.option(
    "--variables",
    metavar="NAMES",
    callback=words_of("theta,dtheta"),
    help="Draw one figure for each of these variables instead, e.g. theta,dtheta.",
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

    A result gives <stem>-motion, <stem>-motor-torque, <stem>-elastic-torque and <stem>-energy, a simulation
    <stem>-motion, <stem>-position-error, <stem>-stiffness-error and <stem>-motor-torque. Both give
    <stem>-losses if the robot has dry friction or dampers, and <stem>-motor-current and <stem>-motor-voltage
    if its motors have the constants for them; results of robots with dampers give <stem>-damper. Two or more
    FILEs give one figure <stem>-<stem>-compare: motor torques of results, or position errors of simulations,
    overlaid joint by joint, and their differences from the first.

    A recording, a CSV file or a trajectory with recorded signals, gives <stem>-recording: the samples of each
    signal, the fitted spline, the residual and the spectra of both. A result computed from a recording gives
    it as well. Joints have the names of the columns, or of --robot.

    A robot gives <stem>-arm (links, joints and motors at q = 0, or in the middle of position limits),
    <stem>-actuators (torque of the springs over deflection) and <stem>-stiffness (attainable stiffness over
    torque, with singularities and limits).

    With --variables the figures are called <stem>-theta or <stem>-<stem>-compare-theta.

    The table of a study gives <stem>-margin (margin over the varied parameters), <stem>-pareto (cost over
    margin) and <stem>-feasibility (share of runs with at least a given margin, compared if there are several
    tables). Where runs were optimized, <stem>-cost replaces the first two.

    The file of vsacli sensitivity -o gives <stem>-ranking: the parameters with the largest effect on the
    motor torques.

    --format html writes one page <stem>.html for a browser, without network access: the report, zoomable
    plots of every variable, and the robot at the time cursor; for results that fail, the fixes of
    check-feasibility --fixes; for several FILEs, their differences; for studies, margin and cost of each run;
    for a robot its figures and parameters.
    It requires the package bokeh: pip install bokeh.
    """
    shown = _Shown(joints or (), _span(start, end), variables)
    if twice := next((file for file in files if files.count(file) > 1), None):
        raise click.UsageError(f"{twice} is given twice; give each result once")
    inputs = [*files, *filter(None, [robot])]
    with naming_kind("FILE", files, DRAWN), Outputs(overwrite=overwrite, inputs=inputs) as outputs:
        target = _Target(figures, outputs)
        kinds = set(map(recognized, files))
        if "robot" in kinds:
            _check_robot(files, shown, robot)
            if page := figures.page(Path(files[0]).stem, outputs):
                write_robot_page(files[0], page)
            else:
                draw_robot(files[0], target.figures, talk)
        elif kinds & RECORDED:
            _check_recording(files, shown, figures.file_format)
            draw_recording(files[0], robot, shown.joints, shown.span, target.figures, talk)
        elif robot is not None:
            raise click.UsageError(
                "--robot is only for recordings; leave it out, results contain their robot"
            )
        else:
            _draw_computed([Path(file) for file in files], shown, target, talk)
    talk.wrote(outputs)


class _Target(NamedTuple):
    """The place of the figures, and the output files of the command."""

    place: FigureTarget
    outputs: Outputs

    def figures(self, names: Iterable[str], stem: str) -> FigureFiles:
        """Stage the files of figures."""
        return self.place.files(names, stem, self.outputs)


def _check_robot(files: tuple[str, ...], shown: _Shown, robot: str | None) -> None:
    """Refuse options that do not apply to figures of robots.

    Raises:
        click.UsageError: with the option, or for several files.
    """
    if len(files) > 1:
        raise click.UsageError("robots are drawn one at a time; give one robot file and nothing else")
    if shown != _EVERYTHING:
        raise click.UsageError(f"{shown.option} cannot be used with a robot; leave it out")
    if robot is not None:
        raise click.UsageError("--robot is only for recordings; leave it out")


def _check_recording(files: tuple[str, ...], shown: _Shown, file_format: str) -> None:
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


def _draw_computed(paths: list[Path], shown: _Shown, target: _Target, talk: Talk) -> None:
    """Draw results, simulations, study tables or a sensitivity analysis."""
    kind = _kind_of(paths)
    if kind in (file_formats.STUDY_TABLE, file_formats.SENSITIVITY) and shown != _EVERYTHING:
        words = "study tables" if kind == file_formats.STUDY_TABLE else "sensitivity files"
        raise click.UsageError(f"{shown.option} cannot be used with {words}; leave it out")
    if kind == file_formats.SENSITIVITY:
        _draw_ranking(paths, target, talk)
    elif target.place.file_format == PAGE:
        if (of_times := shown._replace(span=_EVERYTHING.span)) != _EVERYTHING:
            raise click.UsageError(f"{of_times.option} cannot be used with --format html; leave it out")
        write_page(paths, None if kind == file_formats.STUDY_TABLE else shown.span, *target, talk)
    elif kind == file_formats.STUDY_TABLE:
        _draw_studies(paths, target)
    elif len(paths) == 1:
        _draw_file(paths[0], shown, target, talk)
    else:
        _draw_comparison(paths, shown, target, talk)


class _Shown(NamedTuple):
    """The selection to draw: joints (all if empty), a time span, and variables (default figures if None)."""

    joints: tuple[str, ...]
    span: tuple[float, float]
    variables: tuple[str, ...] | None

    @property
    def option(self) -> str:
        """Name of an option that selects something; empty if everything is to be drawn."""
        first, last = (math.isfinite(end) for end in self.span)
        given = {
            "--variables": self.variables is not None,
            "--joints": self.joints,
            "--from": first,
            "--to": last,
        }
        return next((option for option, chosen in given.items() if chosen), "")

    def of(self, stored: StoredResult) -> StoredResult:
        """Return the selected part of an open file; the file itself if all of it is selected."""
        from vsacli.results.store.excerpt import Excerpt

        everything = not self.joints and self.span == _EVERYTHING.span
        return stored if everything else Excerpt(stored, self.joints, self.span)


_EVERYTHING = _Shown((), (-math.inf, math.inf), None)


def _span(start: float | None, end: float | None) -> tuple[float, float]:
    """Return the first and the last time to draw.

    Raises:
        click.UsageError: the first time is later than the last.
    """
    span = (-math.inf if start is None else start, math.inf if end is None else end)
    if not span[0] <= span[1]:
        raise click.UsageError(f"--from {span[0]:g} must be before --to {span[1]:g}")
    return span


def _kind_of(paths: list[Path]) -> str | None:
    """Return the format of the first file; study tables are only drawn among themselves.

    Raises:
        click.UsageError: some files are study tables, and others are not.
    """
    from vsacli.results.store.reader import stored_format

    there = [path for path in paths if path.is_file()] or paths[:1]  # others are missed when they are read
    formats = [stored_format(path) for path in there]
    are = [each == file_formats.STUDY_TABLE for each in formats]
    if any(are) and not all(are):
        table, other = there[are.index(True)], there[are.index(False)]
        raise click.UsageError(f"{table} is a study table, {other} is not; plot study tables by themselves")
    return formats[0]


def _draw_ranking(paths: list[Path], target: _Target, talk: Talk) -> None:
    """Draw the ranking of a sensitivity file."""
    from vsacli.results.plots import ranking_figure
    from vsacli.results.store.damage import reporting_damage
    from vsacli.results.store.sensitivity_file import StoredSensitivity

    if len(paths) > 1:
        raise click.UsageError("sensitivity analyses are drawn one at a time")
    if target.place.file_format == PAGE:
        raise click.UsageError("--format html is for results, simulations and studies; leave it out")
    with StoredSensitivity.open(paths[0]) as stored, reporting_damage(paths[0]):
        talk.detail(result_line(stored))
        ranking = Ranking.of(stored.report_json, stored.joint_names)
        if stored.report_json.get("band"):
            talk.note(f"{paths[0]}: no figure of the tolerance bands: `vsacli sensitivity --plot` draws it")
    target.figures([RANKING], paths[0].stem).save({RANKING: ranking_figure(ranking)})


def _draw_studies(paths: list[Path], target: _Target) -> None:
    """Draw the figures of a study, or compare the distributions of margins of several studies."""
    from vsacli.results.charts.comparison import COMPARISON
    from vsacli.results.plots import compared_studies, study_figures
    from vsacli.results.store.study_table import StoredStudy

    stem = "-".join(path.stem for path in paths)
    with ExitStack() as stack:
        tables = [stack.enter_context(StoredStudy(path)) for path in paths]
        if len(tables) == 1:
            figures = study_figures(tables[0])
        else:
            figures = {COMPARISON: compared_studies(tables, [path.stem for path in paths])}
    target.figures(figures, stem).save(figures)


def _draw_file(path: Path, shown: _Shown, target: _Target, talk: Talk) -> None:
    """Draw the figures of one file, and of the recording that it was computed from."""
    from vsacli.results.charts.figures import chosen_figures
    from vsacli.results.store.reader import open_stored

    with open_stored(path) as stored:
        talk.detail(result_line(stored))
        part = shown.of(stored)
        with naming_option("--variables"):
            names = chosen_figures(part, shown.variables)
        recorded = shown.variables is None and has_recording(stored, talk)
        figures = target.figures([*names, RECORDING] if recorded else names, path.stem)
        _draw(part, path, figures, talk, shown.variables)
        if recorded:
            from vsacli.files.repetition import rebuilt

            robot, trajectory = rebuilt(stored)
            profiles = trajectory.estimates.values()
            figures.save(recording_figure(robot, profiles, path, shown.joints, shown.span))


def draw_staged(file: Staged, figures: FigureFiles, talk: Talk) -> None:
    """Draw the figures of a file that this command has written."""
    from vsacli.results.store.reader import open_stored

    with open_stored(file.temporary) as stored:
        _draw(stored, file.path, figures, talk)


def _draw(
    stored: StoredResult,
    path: Path,
    figures: FigureFiles,
    talk: Talk,
    variables: tuple[str, ...] | None = None,
) -> None:
    """Draw the figures of an open file; report figures for which variables are missing."""
    from vsacli.results.charts.figures import drawings_of, omitted_figures
    from vsacli.results.plots import draw_stored

    if variables is None:
        for reason in omitted_figures(drawings_of(stored), stored.variables).values():
            talk.note(f"{path}: {reason}")
    for name, figure in draw_stored(stored, variables):
        figures.save({name: figure})
        del figure  # else it stays in memory while the next one is drawn


def _draw_comparison(paths: list[Path], shown: _Shown, target: _Target, talk: Talk) -> None:
    from vsacli.base.variables import select_variables
    from vsacli.results.charts.comparison import comparison_names
    from vsacli.results.plots import compare_files
    from vsacli.results.store.reader import open_stored

    stem = "-".join(path.stem for path in paths)
    files = target.figures(comparison_names(shown.variables), stem)
    with ExitStack() as stack:
        opened = [stack.enter_context(open_stored(path)) for path in paths]
        for each in opened:
            talk.detail(result_line(each))
        with naming_option("--variables"):
            select_variables(shown.variables or (), opened[0].declared)
        files.save(compare_files([shown.of(each) for each in opened], shown.variables))
