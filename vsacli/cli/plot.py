"""`vsacli plot`: figures and pages of results, simulations and studies, and of recordings."""

from __future__ import annotations

import math
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from vsacli.base.errors import InputError, StorageError
from vsacli.cli.command_parts import example, format_option, overwrite_option, result_line, words_of
from vsacli.cli.console import Talk, talk_options
from vsacli.cli.file_names import FILE, FOLDER
from vsacli.cli.input_errors import naming_kind

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from vsacli.base.outputs import Outputs, Staged
    from vsacli.results.plots import FigureFiles
    from vsacli.results.plots.figures import Figures
    from vsacli.results.store.excerpt import Span
    from vsacli.results.store.reader import StoredResult
    from vsacli.robot.model import Robot
    from vsacli.trajectory.recorded.samples import SampledProfile

RECORDING = "recording"
"""Name of the figure of recorded signals, with their splines and the noise found in them."""


@click.command(
    "plot",
    short_help="Plot results, simulations and recordings.",
    epilog=example("vsacli plot result.h5 -o figures --format pdf"),
)
@click.argument("files", type=FILE, metavar="FILE...", nargs=-1, required=True)
@click.option(
    "-o", "--output", "folder", type=FOLDER, default=".", help="Folder for the figures.", show_default=True
)
@format_option
@click.option(
    "--from",
    "start",
    metavar="SECONDS",
    type=float,
    help="First time to draw.",
    show_default="start of the file",
)
@click.option(
    "--to", "end", metavar="SECONDS", type=float, help="Last time to draw.", show_default="end of the file"
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
    folder: str,
    file_format: str,
    start: float | None,
    end: float | None,
    joints: tuple[str, ...] | None,
    variables: tuple[str, ...] | None,
    robot: str | None,
    overwrite: bool,
    talk: Talk,
) -> None:
    """Draw the figures of a result, a simulation, a recording or a study, or compare several results.

    A result gives <stem>-motion, <stem>-motor-torque, <stem>-elastic-torque and <stem>-energy, a simulation
    <stem>-motion, <stem>-position-error, <stem>-stiffness-error and <stem>-motor-torque. Both give
    <stem>-losses if the robot has dry friction or dampers, and <stem>-motor-current and <stem>-motor-voltage
    if its motors have the constants for them; results of robots with dampers give <stem>-damper. Two or more
    FILEs give one figure <stem>-<stem>-compare: motor torques of results, or position errors of simulations,
    overlaid joint by joint, and their differences from the first.

    A recording, a CSV file or a trajectory with recorded signals, gives <stem>-recording: the samples of each
    signal, the fitted spline, the residual and the spectra of both. A result computed from a recording gives
    it as well. Joints have the names of the columns, or of --robot.

    With --variables the figures are called <stem>-theta or <stem>-<stem>-compare-theta.

    The table of a study gives <stem>-margin (margin over the varied parameters), <stem>-pareto (cost over
    margin) and <stem>-feasibility (share of runs with at least a given margin, compared if there are several
    tables). Where runs were optimized, <stem>-cost replaces the first two.

    --format html writes one page <stem>.html for a browser, without network access: the report, zoomable
    plots of every variable, and the robot at the time cursor; for results that fail, the fixes of
    check-feasibility --fixes; for several FILEs, their differences; for studies, margin and cost of each run.
    It requires the package bokeh: pip install bokeh.
    """
    from vsacli.base.outputs import Outputs

    shown = _Shown(joints or (), _span(start, end), variables)
    kinds = naming_kind("FILE", files, ("result", "simulation", "table of a study", "table", "trajectory"))
    with kinds, Outputs(overwrite=overwrite, inputs=[*files, *filter(None, [robot])]) as outputs:
        target = _Target(Path(folder), file_format, outputs)
        if any(map(is_recording, files)):
            _check_recording(files, shown, file_format)
            draw_recording(files[0], robot, shown.joints, shown.span, target.figures, talk)
        elif robot is not None:
            raise click.UsageError("--robot is the robot of a recording; results name theirs")
        else:
            _draw_computed([Path(file) for file in files], shown, target, talk)
    talk.wrote(outputs)


class _Target(NamedTuple):
    """The folder, format and staged files of figures."""

    folder: Path
    file_format: str
    outputs: Outputs

    def figures(self, names: Iterable[str], stem: str) -> FigureFiles:
        """Stage the files of figures."""
        from vsacli.results.plots import FigureFiles

        return FigureFiles(names, self.folder, stem, self.file_format, self.outputs)


def _check_recording(files: tuple[str, ...], shown: _Shown, file_format: str) -> None:
    """Refuse options that do not apply to figures of recordings.

    Raises:
        click.UsageError: with the option, or for several files.
    """
    if len(files) > 1:
        raise click.UsageError(
            "recordings are drawn one at a time; `vsacli compare` compares one with a result"
        )
    if shown.variables is not None or file_format == "html":
        option = "--format html" if shown.variables is None else "--variables"
        raise click.UsageError(f"{option} needs a result, which `vsacli invdyn` computes from a recording")


def _draw_computed(paths: list[Path], shown: _Shown, target: _Target, talk: Talk) -> None:
    """Draw results, simulations or study tables."""
    studies = _are_studies(paths)
    if studies and shown != _EVERYTHING:
        raise click.UsageError("times, joints and variables can be chosen of results, not of studies")
    if target.file_format == "html":
        from vsacli.cli.plot_page import write_page

        if shown._replace(span=_EVERYTHING.span) != _EVERYTHING:
            raise click.UsageError("a page shows all joints and variables; leave these options out")
        write_page(paths, None if studies else shown.span, target.folder, target.outputs, talk)
    elif studies:
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
        raise click.UsageError(f"--from {span[0]:g} has to lie before --to {span[1]:g}")
    return span


def _are_studies(paths: list[Path]) -> bool:
    """Return whether the first file is a study table; then all files must be."""
    from vsacli.results.store.reader import stored_format
    from vsacli.results.store.study_table import FORMAT

    return stored_format(paths[0]) == FORMAT


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
    from vsacli.results.charts.comparison import comparison_names
    from vsacli.results.plots import compare_files
    from vsacli.results.store.reader import open_stored

    stem = "-".join(path.stem for path in paths)
    files = target.figures(comparison_names(shown.variables), stem)
    with ExitStack() as stack:
        opened = [stack.enter_context(open_stored(path)) for path in paths]
        for each in opened:
            talk.detail(result_line(each))
        files.save(compare_files([shown.of(each) for each in opened], shown.variables))


def is_recording(path: str) -> bool:
    """Return whether a file is a CSV table or a trajectory; False if its kind is unknown."""
    from vsacli.files.file_kinds import FileKind, recognize

    try:
        return recognize(path) in (FileKind.TABLE, FileKind.TRAJECTORY)
    except (InputError, StorageError):
        return False  # readers of results and simulations report its problems


def draw_recording(
    path: str,
    robot_path: str | None,
    joints: tuple[str, ...],
    span: Span,
    staged: Callable[[list[str], str], FigureFiles],
    talk: Talk,
) -> None:
    """Draw the figure of a recording, or of a trajectory with recorded signals.

    Args:
        path: recording or trajectory file.
        robot_path: robot file; None: joints are named by the columns.
        joints: names of the joints to show; all if empty.
        span: first and last time to show, s.
        staged: callable that stages the files of figures, given their names and the beginning of the file
            names.
        talk: shows the progress of the fit.

    Raises:
        InputError: the file cannot be used, or no spline was fitted to it.
        StorageError: the figure cannot be written.
    """
    from vsacli.documents.source import is_table
    from vsacli.files.placeholder_robot import placeholder_robot
    from vsacli.files.recordings.fit_curves import table_profiles
    from vsacli.robot.file import load_robot
    from vsacli.trajectory.file import load_trajectory

    robot = placeholder_robot(path).robot if robot_path is None else load_robot(robot_path)
    figures = staged([RECORDING], Path(path).stem)
    if is_table(path):
        profiles = table_profiles(path, robot, talk.fitting)
    else:
        profiles = [*load_trajectory(path, robot, progress=talk.fitting).estimates.values()]
    if not any(profile.fitted for profile in profiles):
        reason = "its signals are not recorded, or recorded with all derivatives"
        raise InputError.one(f"has no spline to be shown: {reason}; plot the result of `vsacli invdyn`", path)
    figures.save(recording_figure(robot, profiles, path, joints, span))


def recording_figure(
    robot: Robot,
    profiles: Iterable[SampledProfile],
    file: str | Path,
    joints: tuple[str, ...] = (),
    span: Span | None = None,
) -> Figures:
    """Return the figure of recorded signals, by its name.

    Args:
        robot: robot that was recorded.
        profiles: recorded signals; a spline was fitted to at least one.
        file: path in the title and in errors.
        joints: names of the joints to show; all if empty.
        span: first and last time to show, s; all times if None.

    Raises:
        InputError: a joint is unknown, or no sample lies in the span.
    """
    from vsacli.files.recordings.fit_curves import recorded_curves
    from vsacli.results.plots import recorded_figure
    from vsacli.results.store.excerpt import WHOLE

    curves = recorded_curves(profiles, robot.joint_types, file, joints, span or WHOLE)
    return {RECORDING: recorded_figure(curves, f"{Path(file).stem}: recorded signals and their splines")}


def has_recording(stored: StoredResult, talk: Talk) -> bool:
    """Return whether the recording behind a result can be drawn; print a note if it exists but cannot."""
    from vsacli.base.version import __version__

    if stored.kind != "result" or not stored.report_json.get("fits"):
        return False
    inputs, made_by = stored.inputs(), stored.provenance()["generated_by"]
    if not inputs or any(each.content is None for each in inputs):
        reason = "the result does not hold it"
    elif made_by != (this := f"vsacli {__version__}"):
        reason = f"the result was computed by {made_by}, and this is {this}"
    else:
        return True
    talk.note(f"{stored.path}: no figure of its recording: {reason}")
    return False
