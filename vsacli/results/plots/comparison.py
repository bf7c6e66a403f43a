"""Several files of a kind on the same axes.

Of results the motor torques, after Fig. 4 of Buondonno & De Luca (2016), of simulations the position errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsacli.base.arrays import BoolArray
from vsacli.base.errors import InputError
from vsacli.base.units import POSITION, TORQUE
from vsacli.base.variables import MOTORS
from vsacli.results.curves import Failures, read_curves
from vsacli.results.plots.drawing import draw_bands, draw_curve, house_style, line_handle, line_style
from vsacli.results.plots.panels import (
    PANEL_WIDTH,
    Label,
    add_title,
    complete,
    folding,
    joint_panels,
    missing_variables,
)
from vsacli.results.several import check_comparable, distinct_labels
from vsacli.results.store.reader import StoredResult

COMPARISON = "compare"
"""Name of the figure; the file is called `<stem>-compare`."""

MOST_ROWS = 7


class _Compared(NamedTuple):
    """What is compared of files of a kind.

    Attributes:
        variable: the variable, a column of panels for each of its curves.
        words: for the title of the figure.
        columns: what the title of a panel adds to the name of its joint.
        labels: of the axes.
    """

    variable: str
    words: str
    columns: Sequence[str]
    labels: Sequence[Label]


def _torque_label(motor: int, joint_type: str) -> str:
    return rf"$\tau_{motor}$ [{TORQUE.unit(joint_type)}]"


def _error_label(joint_type: str) -> str:
    return f"$q - q_d$ [{POSITION.unit(joint_type)}]"


_COMPARED = {
    "result": _Compared(
        "tau_motor",
        "motor torques",
        [f", motor {motor}" for motor in MOTORS],
        [partial(_torque_label, motor) for motor in MOTORS],
    ),
    "simulation": _Compared("q_error", "position errors", [""], [_error_label]),
}


def compare_files(files: Sequence[StoredResult]) -> Figure:
    """Overlay results, or simulations, of the same joints: a row of panels per joint, a column per curve.

    Raises:
        InputError: the files are of different kinds or have different joints, or one was written without the
            variable that is compared.
    """
    check_comparable(files)
    compared = _COMPARED[files[0].kind]
    for file in files:
        _check_holds(file, compared)
    with house_style():
        return _comparison(files, compared)


def _check_holds(file: StoredResult, compared: _Compared) -> None:
    if compared.variable not in file.variables:
        raise InputError.one(missing_variables(COMPARISON, [compared.variable]), file.path)


def _comparison(results: Sequence[StoredResult], compared: _Compared) -> Figure:
    there = _curves(results, compared.variable)
    joints, columns = there.shape
    rows, folds = folding(joints, MOST_ROWS)
    width = max(2, folds * columns) * PANEL_WIDTH
    figure = Figure((width, 1.6 * rows + 1.2), layout="constrained")
    time = np.sort(np.concatenate([result.time[[0, -1]] for result in results]))
    grid = joint_panels(figure.add_gridspec()[0], time, there, MOST_ROWS)
    panels = [row[exists].tolist() for row, exists in zip(grid, there, strict=True)]
    _annotate(panels, results[0], compared)
    handles = [line_handle(line_style(index), label) for index, label in enumerate(distinct_labels(results))]
    for index, result in enumerate(results):
        handles += _overlay(panels, result, index, compared.variable)
    robots = " / ".join(dict.fromkeys(result.robot_name for result in results))
    return complete(figure, f"{robots}, {compared.words}", handles)


def _curves(results: Sequence[StoredResult], variable: str) -> BoolArray:
    """Which curves of the variable any of the results has at each joint, (joints, 1 or 2)."""
    there = np.any([result.existing(result.declared[variable]) for result in results], axis=0)
    columns = int(np.count_nonzero(np.any(there, axis=0)))
    return np.asarray(there)[:, :columns]


def _annotate(panels: list[list[Axes]], result: StoredResult, compared: _Compared) -> None:
    for row, name, joint_type in zip(panels, result.joint_names, result.joint_types, strict=True):
        for axes, column, label in zip(row, compared.columns, compared.labels, strict=False):
            add_title(axes, f"{name}{column}")
            axes.set_ylabel(label(joint_type))


def _overlay(panels: list[list[Axes]], result: StoredResult, index: int, variable: str) -> list[Artist]:
    """Draw one of the results over all panels; returns what a legend shows for its bands."""
    failures = Failures.of(result)
    handles: list[Artist] = []
    for joint, curves in enumerate(read_curves(result, [variable])):
        for axes, values in zip(panels[joint], curves.values, strict=False):
            draw_curve(axes, curves.time, values, index, line_style(index))
            handles += draw_bands(axes, failures.time, *failures.among([joint]))
    return handles
