"""The figure of a recording: its samples, the fitted splines, and the noise found in them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from vsacli.base.errors import InputError
from vsacli.cli.command_parts import read_robot
from vsacli.cli.console import Talk
from vsacli.cli.drawings import RECORDING
from vsacli.documents.source import is_table
from vsacli.files.placeholder_robot import placeholder_robot
from vsacli.files.recordings.fit_curves import recorded_curves, table_profiles
from vsacli.results.plots import FigureFiles, recorded_figure
from vsacli.results.plots.figures import Figures
from vsacli.results.store.excerpt import WHOLE, Span
from vsacli.robot.model import Robot
from vsacli.trajectory.file import load_trajectory
from vsacli.trajectory.recorded.samples import SampledProfile


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
    robot = read_robot(robot_path, argument="--robot") if robot_path else placeholder_robot(path).robot
    figures = staged([RECORDING], Path(path).stem)
    if is_table(path):
        profiles = table_profiles(path, robot, talk.fitting)
    else:
        profiles = [*load_trajectory(path, robot, progress=talk.fitting).estimates.values()]
    if not any(profile.fitted for profile in profiles):
        advice = f"compute a result first: vsacli invdyn ROBOT {path}, then vsacli plot"
        raise InputError.one(f"has no recorded signals to plot; {advice}", path)
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
    curves = recorded_curves(profiles, robot.joint_types, file, joints, span or WHOLE)
    return {RECORDING: recorded_figure(curves, f"{Path(file).stem}: recorded signals and their splines")}
