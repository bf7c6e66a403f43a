"""The motor torques of several results on the same axes, after Fig. 4 of Buondonno & De Luca (2016)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsacli.arrays import BoolArray
from vsacli.errors import InputError
from vsacli.plots.curves import Failures, read_curves
from vsacli.plots.drawing import draw_bands, draw_curve, line_handle
from vsacli.plots.layout import (
    PANEL_WIDTH,
    add_title,
    complete,
    folding,
    joint_panels,
    missing_variables,
)
from vsacli.plots.style import house_style, line_style
from vsacli.store.reader import StoredResult
from vsacli.units import TORQUE
from vsacli.variables import MOTORS, VARIABLES, existing

COMPARISON = "compare"
"""Name of the figure; the file is called `<stem>-compare`."""

MOST_ROWS = 7


def compare_results(results: Sequence[StoredResult]) -> Figure:
    """Overlay the motor torques of results of the same joints: a row of panels per joint, a column per motor.

    Raises:
        InputError: the results have different joints, or one was written without motor torques.
    """
    for result in results:
        _check_comparable(result, results[0])
    with house_style():
        return _comparison(results)


def _check_comparable(result: StoredResult, first: StoredResult) -> None:
    if "tau_motor" not in result.variables:
        raise InputError.one(missing_variables(COMPARISON, ["tau_motor"]), result.path)
    if _joints(result) != _joints(first):
        message = (
            f"cannot be compared with {first.path}: it has the joints {_joints(result)}, "
            f"the other has {_joints(first)}; compare results of the same robot"
        )
        raise InputError.one(message, result.path)


def _joints(result: StoredResult) -> str:
    pairs = zip(result.joint_names, result.joint_types, strict=True)
    return ", ".join(f"{name} ({joint_type})" for name, joint_type in pairs)


def _comparison(results: Sequence[StoredResult]) -> Figure:
    there = _motors(results)
    joints, columns = there.shape
    rows, folds = folding(joints, MOST_ROWS)
    figure = Figure((folds * columns * PANEL_WIDTH, 1.6 * rows + 1.2), layout="constrained")
    time = np.sort(np.concatenate([result.time[[0, -1]] for result in results]))
    grid = joint_panels(figure.add_gridspec()[0], time, there, MOST_ROWS)
    panels = [row[exists].tolist() for row, exists in zip(grid, there, strict=True)]
    _annotate(panels, results[0])
    handles = [line_handle(line_style(index), label) for index, label in enumerate(distinct_labels(results))]
    for index, result in enumerate(results):
        handles += _overlay(panels, result, index)
    robots = " / ".join(dict.fromkeys(result.robot_name for result in results))
    return complete(figure, f"{robots}, motor torques", handles)


def _motors(results: Sequence[StoredResult]) -> BoolArray:
    """Which motors any of the results has at each joint, (joints, 1 or 2)."""
    there = np.any([existing(VARIABLES["tau_motor"], result.actuators) for result in results], axis=0)
    columns = int(np.count_nonzero(np.any(there, axis=0)))
    return np.asarray(there)[:, :columns]


def _annotate(panels: list[list[Axes]], result: StoredResult) -> None:
    for row, name, joint_type in zip(panels, result.joint_names, result.joint_types, strict=True):
        for axes, motor in zip(row, MOTORS, strict=False):
            add_title(axes, f"{name}, motor {motor}")
            axes.set_ylabel(rf"$\tau_{motor}$ [{TORQUE.unit(joint_type)}]")


def _overlay(panels: list[list[Axes]], result: StoredResult, index: int) -> list[Artist]:
    """Draw one of the results over all panels; returns what a legend shows for its bands."""
    failures = Failures.of(result)
    handles: list[Artist] = []
    for joint, curves in enumerate(read_curves(result, ["tau_motor"])):
        for axes, torque in zip(panels[joint], curves.values, strict=False):
            draw_curve(axes, curves.time, torque, index, line_style(index))
            handles += draw_bands(axes, failures.time, *failures.among([joint]))
    return handles


def distinct_labels(results: Sequence[StoredResult]) -> list[str]:
    """Names of the trajectories; where two are equal, all with the stem of their file, or with its path."""
    for label in _LABELS:
        labels = [label(result) for result in results]
        if len(set(labels)) == len(labels):
            return labels
    return [f"{number}: {label}" for number, label in enumerate(labels, start=1)]


_LABELS: tuple[Callable[[StoredResult], str], ...] = (
    lambda result: result.trajectory_name,
    lambda result: f"{result.trajectory_name} ({Path(result.path).stem})",
    lambda result: f"{result.trajectory_name} ({result.path})",
)
