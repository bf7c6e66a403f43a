"""Panels, legend and title of a figure, for any number of joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.legend import Legend

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.units import TIME
from vsacli.results.plots.letters import make_legible
from vsacli.results.plots.styles import shortened
from vsacli.results.store.reader import StoredResult

PANEL_WIDTH = 3.0
"""Inches: with fonts of 10 pt, two panels side by side stay readable in one column of a paper."""

LATE = 1e5
"""First time, s, from which on ticks count from it: their digits would not fit side by side."""

FINE, FEW_TICKS = 0.1, 4
"""Length of a span, s, below which the digits of more than so many ticks would not fit side by side."""

JOINTS_PER_PANEL = 7
TITLE_LENGTH, LABEL_BESIDE = 70, 16
"""Characters of a title, and of a name beside a panel."""

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


def joint_panels(
    place: SubplotSpec,
    time: FloatArray,
    present: BoolArray,
    most_rows: int,
    heights: Sequence[float] = (1.0,),
) -> AxesGrid:
    """Panels of each joint, (joints * heights, columns), with a common time axis in each column.

    Args:
        place: where they go.
        time: what the time axes span, ascending, s.
        present: (joints, columns), which panels there are, one joint below the other; others are removed.
        most_rows: joints below each other before the next begins beside them.
        heights: of the panels that a joint has, one below the other, relative to each other.
    """
    joints, columns = present.shape
    rows, folds = folding(joints, most_rows)
    each = len(heights)
    places = place.subgridspec(rows * each, folds * columns, height_ratios=[*heights] * rows)
    grid = places.subplots(squeeze=False).reshape(rows * each, folds, columns)
    panels = grid.swapaxes(0, 1).reshape(-1, columns)
    for unused in panels[joints * each :].flat:
        unused.remove()
    present = np.repeat(present, each, axis=0)
    for first in range(0, len(present), rows * each):
        fold = slice(first, min(first + rows * each, len(present)))
        share_time(panels[fold], present[fold], time)
    return panels[: joints * each]


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
        if time[-1] - time[0] < FINE:
            column[-1].locator_params(axis="x", nbins=FEW_TICKS)


def add_title(axes: Axes, title: str) -> None:
    """The title of a panel, at its left and taken literally."""
    axes.set_title(shortened(title), loc="left", parse_math=False)


def add_legend(axes: Axes, handles: Sequence[Artist]) -> None:
    """Name these beside a panel, at its right."""
    labels = [shortened(str(handle.get_label()), LABEL_BESIDE) for handle in handles]
    legend = axes.legend(handles, labels, loc="center left", bbox_to_anchor=(1.0, 0.5))
    _take_literally(legend)


def complete(figure: Figure, title: str, handles: Sequence[Artist]) -> Figure:
    """Add the title and, below all panels, one legend with each label once in as many columns as fit."""
    figure.suptitle(shortened(title, TITLE_LENGTH), fontsize=11, parse_math=False)
    by_label = {str(handle.get_label()): handle for handle in handles}
    if by_label:
        labels = [shortened(label) for label in by_label]
        width = _INCHES_PER_HANDLE + _INCHES_PER_CHARACTER * max(map(len, labels))
        rows = math.ceil(len(labels) / max(1, int(figure.get_figwidth() / width)))
        columns = math.ceil(len(labels) / rows)
        legend = figure.legend(list(by_label.values()), labels, loc="outside lower center", ncols=columns)
        _take_literally(legend)
    make_legible(figure)
    return figure


def _take_literally(legend: Legend) -> None:
    for text in legend.get_texts():
        text.set_parse_math(False)


def result_title(result: StoredResult) -> str:
    """Robot and trajectory, once if they are called alike, and where an incomplete run ended."""
    ending = "" if result.complete else f" (stopped at {result.time[-1]:.4g} s)"
    return ", ".join(dict.fromkeys((result.robot_name, result.trajectory_name))) + ending


def missing_variables(figure: str, variables: Sequence[str]) -> str:
    """The sentence for a figure that cannot be drawn."""
    needed = " and ".join(variables)
    return f"figure {figure} needs {needed}, which this result was written without (--variables)"
