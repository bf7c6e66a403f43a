"""`vsacli plot` of recordings: how noise in them was judged."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vsacli.base.errors import InputError, StorageError
from vsacli.cli.console import Talk

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from vsacli.results.plots import FigureFiles
    from vsacli.results.plots.drawings import Figures
    from vsacli.results.store.excerpt import Span
    from vsacli.results.store.reader import StoredResult
    from vsacli.robot.model import Robot
    from vsacli.trajectory.recorded.samples import SampledProfile

RECORDING = "recording"
"""Name of the figure."""


def is_recording(path: str) -> bool:
    """Return whether a file is a CSV table or a trajectory; false if that cannot be told."""
    from vsacli.files.file_kinds import FileKind, recognise

    try:
        return recognise(path) in (FileKind.TABLE, FileKind.TRAJECTORY)
    except (InputError, StorageError):
        return False  # those who read results and simulations say what is wrong with it


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
        path: the file.
        robot_path: the robot that it is of; None: joints are those of the columns.
        joints: names of those to show; all if there are none.
        span: first and last time to show, s.
        staged: stages files for figures, given their names and what these begin with.
        talk: shows how far the fit is.

    Raises:
        InputError: the file cannot be used, or nothing was fitted to it.
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
        robot: that was recorded.
        profiles: the signals; a spline was fitted to at least one.
        file: named in the title and in errors.
        joints: names of those to show; all if there are none.
        span: first and last time to show, s; all if it is None.

    Raises:
        InputError: there is no such joint, or no sample at these times.
    """
    from vsacli.files.recordings.fit_curves import recorded_curves
    from vsacli.results.plots import recorded_figure
    from vsacli.results.store.excerpt import WHOLE

    curves = recorded_curves(profiles, robot.joint_types, file, joints, span or WHOLE)
    return {RECORDING: recorded_figure(curves, f"{Path(file).stem}: recorded signals and their splines")}


def has_recording(stored: StoredResult, talk: Talk) -> bool:
    """Return whether the recording that a result was computed from can be drawn; a note says if it cannot."""
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
