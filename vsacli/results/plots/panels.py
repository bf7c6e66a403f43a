"""Panels, labels, legend and title of a figure, for any number of joints; those of one unit share panels."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.units import TIME, TORQUE
from vsacli.base.variables import MOTORS, deviation
from vsacli.results.curves import Failures, read_curves
from vsacli.results.plots.drawing import (
    draw_bands,
    draw_curve,
    draw_limits,
    draw_uncertainty,
    line_handle,
    line_style,
    shortened,
)
from vsacli.results.store.reader import StoredResult

PANEL_WIDTH = 3.0
"""Inches: with fonts of 10 pt, two panels side by side stay readable in one column of a paper."""

LATE = 1e5
"""First time, s, from which on ticks count from it: their digits would not fit side by side."""

JOINTS_PER_PANEL = 7
TITLE_LENGTH = 70

_INCHES_PER_CHARACTER = 0.07
_INCHES_PER_HANDLE = 0.7

AxesGrid = npt.NDArray[Any]
"""Panels in rows and columns."""


def panel_groups(joint_types: Sequence[str]) -> list[list[int]]:
    """Joints that share a panel: of one type, hence one unit, and evenly split where they are many."""
    groups: list[list[int]] = []
    for joint_type in dict.fromkeys(joint_types):
        joints = [joint for joint, other in enumerate(joint_types) if other == joint_type]
        panels = math.ceil(len(joints) / JOINTS_PER_PANEL)
        groups += [part.tolist() for part in np.array_split(joints, panels)]
    return groups


def folding(joints: int, most_rows: int) -> tuple[int, int]:
    """Rows, and how often to begin beside them, for one row of panels per joint."""
    folds = math.ceil(joints / most_rows)
    return math.ceil(joints / folds), folds


def joint_panels(place: SubplotSpec, time: FloatArray, present: BoolArray, most_rows: int) -> AxesGrid:
    """Panels of each joint, (joints, columns), with a common time axis from column to column.

    Args:
        place: where they go.
        time: what the time axes span, ascending, s.
        present: (joints, columns), which panels there are, one joint below the other; others are removed.
        most_rows: joints below each other before the next begins beside them.
    """
    joints, columns = present.shape
    rows, folds = folding(joints, most_rows)
    grid = place.subgridspec(rows, folds * columns).subplots(squeeze=False)
    panels = grid.reshape(rows, folds, columns).swapaxes(0, 1).reshape(-1, columns)
    for unused in panels[joints:].flat:
        unused.remove()
    for first in range(0, joints, rows):
        fold = slice(first, min(first + rows, joints))
        share_time(panels[fold], present[fold], time)
    return panels[:joints]


def share_time(panels: AxesGrid, present: BoolArray, time: FloatArray) -> None:
    """Remove the panels that are not present; those of each column share a time axis over this span."""
    for unused in panels[~present]:
        unused.remove()
    for column, there in zip(panels.T, present.T, strict=True):
        if there.any():
            _share_time(column[there], time)


def _share_time(column: Sequence[Axes], time: FloatArray) -> None:
    """Let panels, top to bottom, share a time axis, labelled below the last."""
    for axes in column[:-1]:
        axes.sharex(column[-1])
        axes.tick_params(labelbottom=False)
    column[-1].set_xlabel(f"time [{TIME}]")
    if time[0] >= LATE:
        whole = math.floor(time[0])
        column[-1].set_xlabel(f"time after {whole} {TIME} [{TIME}]")
        column[-1].xaxis.set_major_formatter(lambda tick, _: f"{tick - whole:g}")
    if time[-1] > time[0]:
        column[-1].set_xlim(time[0], time[-1])


def add_title(axes: Axes, title: str) -> None:
    """The title of a panel, at its left and taken literally."""
    axes.set_title(shortened(title), loc="left", parse_math=False)


def complete(figure: Figure, title: str, handles: Sequence[Artist]) -> Figure:
    """Add the title and, below all panels, one legend with each label once in as many columns as fit."""
    figure.suptitle(shortened(title, TITLE_LENGTH), fontsize=11, parse_math=False)
    by_label = {str(handle.get_label()): handle for handle in handles}
    labels = [shortened(label) for label in by_label]
    width = _INCHES_PER_HANDLE + _INCHES_PER_CHARACTER * max(map(len, labels))
    rows = math.ceil(len(labels) / max(1, int(figure.get_figwidth() / width)))
    columns = math.ceil(len(labels) / rows)
    legend = figure.legend(list(by_label.values()), labels, loc="outside lower center", ncols=columns)
    for text in legend.get_texts():
        text.set_parse_math(False)
    return figure


def result_title(result: StoredResult) -> str:
    """Robot and trajectory, once if they are called alike, and where an incomplete run ended."""
    ending = "" if result.complete else f" (stopped at {result.time[-1]:.4g} s)"
    return ", ".join(dict.fromkeys((result.robot_name, result.trajectory_name))) + ending


def missing_variables(figure: str, variables: Sequence[str]) -> str:
    """The sentence for a figure that cannot be drawn."""
    needed = " and ".join(variables)
    return f"figure {figure} needs {needed}, which this result was written without (--variables)"


GROUP_HEIGHT = 2.3
"""Inches."""

Label = Callable[[str], str]
"""Label of an axis for a type of joint."""


def grouped_figure(
    result: StoredResult, failures: Failures, name: str, labels: Sequence[Label], limit: str = ""
) -> Figure:
    """A figure of one variable that some joint has, with a column of panels for each of its curves.

    Args:
        result: the file.
        failures: its steps that cannot be done.
        name: of the variable.
        labels: of the axes, for each curve.
        limit: constant of the motors that bounds the size of the variable, if one does.
    """
    height = GROUP_HEIGHT * len(panel_groups(result.joint_types)) + 1
    figure = Figure((2 * PANEL_WIDTH, height), layout="constrained")
    handles = draw_groups(figure.add_gridspec()[0], result, failures, name, labels, limit)
    return complete(figure, result_title(result), handles)


def draw_groups(
    place: SubplotSpec,
    result: StoredResult,
    failures: Failures,
    name: str,
    labels: Sequence[Label],
    limit: str = "",
) -> list[Artist]:
    """Draw a variable, a row of panels for each group of joints that have it; returns what a legend shows."""
    there = result.existing(result.declared[name])
    drawn = np.flatnonzero(there.any(axis=0)).tolist()
    groups = [group for group in panel_groups(result.joint_types) if there[group].any()]
    bounds = result.motor_constant(limit) if limit else None
    uncertain = deviation(name) in result.variables
    joints = read_curves(result, [name, deviation(name)] if uncertain else [name])
    panels = place.subgridspec(len(groups), len(drawn)).subplots(squeeze=False)
    handles = [line_handle(line_style(joint), name) for joint, name in enumerate(result.joint_names)]
    for group, row in zip(groups, panels, strict=True):
        for curve, axes in zip(drawn, row, strict=True):
            present = [joint for joint in group if there[joint, curve]]
            for joint in present:
                draw_curve(axes, joints[joint].time, joints[joint].values[curve], joint, line_style(joint))
            for joint in present if uncertain else ():
                curves, deviations = np.split(joints[joint].values, 2)
                handles += draw_uncertainty(
                    axes, joints[joint].time, curves[curve], deviations[curve], line_style(joint)
                )
            if bounds is not None:
                handles += draw_limits(axes, {joint: bounds[joint, curve] for joint in present})
            handles += draw_bands(axes, failures.time, *failures.among(group))
            axes.set_ylabel(labels[curve](result.joint_types[group[0]]))
    share_time(panels, np.array([there[group][:, drawn].any(axis=0) for group in groups]), failures.time)
    return handles


def force(joint_type: str) -> str:
    """What a joint of this type is moved by."""
    return "torque" if joint_type == "revolute" else "force"


def _motor_label(motor: int, joint_type: str) -> str:
    return rf"motor {force(joint_type)} $\tau_{motor}$ [{TORQUE.unit(joint_type)}]"


MOTOR_LABELS: tuple[Label, ...] = tuple(partial(_motor_label, motor) for motor in MOTORS)
"""Of the axes for the torques, or forces, of the motors."""
