"""Several files of a kind on the same axes, and below by how much they differ from the first.

Of results the motor torques, after Fig. 4 of Buondonno & De Luca (2016), of simulations the position errors,
unless other variables are asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import InputError
from vsacli.results.curves import Curves, Failures, read_curves
from vsacli.results.near_singular import GROWING
from vsacli.results.plots.drawing import ZERO, draw_bands, draw_curve
from vsacli.results.plots.labels import Label, label, motor_labels, variable_labels
from vsacli.results.plots.panels import (
    PANEL_WIDTH,
    AxesGrid,
    add_title,
    complete,
    folding,
    joint_panels,
    missing_variables,
)
from vsacli.results.plots.scale import Peaked, cut_peaks
from vsacli.results.plots.styles import house_style, line_handle, line_style
from vsacli.results.plots.variable_figures import drawable_variables
from vsacli.results.several import Difference, check_comparable, distinct_labels
from vsacli.results.store.reader import StoredResult

COMPARISON = "compare"
"""Name of the figure; the file is called `<stem>-compare`."""

MOST_ROWS = 7
HEIGHTS = (1.6, 0.9)
"""Inches: of a panel, and of that below with the differences."""


class _Compared(NamedTuple):
    """What is compared of files of a kind.

    Attributes:
        variable: the variable, a column of panels for each of its curves.
        words: for the title of the figure.
        labels: of the axes.
    """

    variable: str
    words: str
    labels: Sequence[Label]


_COMPARED = {
    "result": _Compared("tau_motor", "motor torques", motor_labels(r"$\tau_{motor}$", units.TORQUE)),
    "simulation": _Compared("q_error", "position errors", [label("$q - q_d$", units.POSITION)]),
}


def comparison_names(variables: Sequence[str] | None) -> list[str]:
    """Names of the figures that compare these variables, or what is compared if none are asked for."""
    return [COMPARISON] if variables is None else [f"{COMPARISON}-{variable}" for variable in variables]


def compare_files(files: Sequence[StoredResult], variables: Sequence[str] | None = None) -> dict[str, Figure]:
    """Overlay results, or simulations, of the same joints: a row of panels per joint, a column per curve.

    Args:
        files: open, all of a kind.
        variables: names of those to compare, by default one that depends on the kind.

    Returns:
        The figures by name, see `comparison_names`.

    Raises:
        InputError: the files are of different kinds or have different joints, or one was written without a
            variable that is compared.
    """
    check_comparable(files)
    if variables is None:
        several = [_COMPARED[files[0].kind]]
    else:
        for file in files:
            chosen = drawable_variables(file, variables)
        several = [_Compared(each.name, each.long_name, variable_labels(each)) for each in chosen]
    for file in files:
        _check_holds(file, several)
    with house_style():
        drawn = [_comparison(files, compared) for compared in several]
    names = comparison_names(None if variables is None else [each.variable for each in several])
    return dict(zip(names, drawn, strict=True))


def _check_holds(file: StoredResult, several: Sequence[_Compared]) -> None:
    missing = [each.variable for each in several if each.variable not in file.variables]
    if missing:
        raise InputError.one(missing_variables(COMPARISON, missing), file.path)


def _comparison(results: Sequence[StoredResult], compared: _Compared) -> Figure:
    there = _curves(results, compared.variable)
    joints, columns = there.shape
    rows, folds = folding(joints, MOST_ROWS)
    figure = Figure((max(2, folds * columns) * PANEL_WIDTH, sum(HEIGHTS) * rows + 1.2), layout="constrained")
    time = np.sort(np.concatenate([result.time[[0, -1]] for result in results]))
    grid = joint_panels(figure.add_gridspec()[0], time, there, MOST_ROWS, HEIGHTS)
    over, apart = grid[::2], grid[1::2]
    _annotate(over, there, results[0], compared)
    handles = [line_handle(line_style(index), label) for index, label in enumerate(distinct_labels(results))]
    failures = [Failures.of(result) for result in results]
    handles += _overlay(over, there, results, failures, compared.variable)
    handles += _draw_differences(apart, there, results, failures, compared)
    robots = " / ".join(dict.fromkeys(result.robot_name for result in results))
    return complete(figure, f"{robots}, {compared.words}", handles)


def _curves(results: Sequence[StoredResult], variable: str) -> BoolArray:
    """Which curves of the variable any of the results has at each joint, (joints, 1 or 2)."""
    there = np.any([result.existing(result.declared[variable]) for result in results], axis=0)
    columns = int(np.count_nonzero(np.any(there, axis=0)))
    return np.asarray(there)[:, :columns]


def _annotate(panels: AxesGrid, there: BoolArray, result: StoredResult, compared: _Compared) -> None:
    several = len(compared.labels) > 1
    for joint, curve in np.argwhere(there).tolist():
        axes: Axes = panels[joint, curve]
        add_title(axes, result.joint_names[joint] + (f", motor {curve + 1}" if several else ""))
        axes.set_ylabel(compared.labels[curve](result.joint_types[joint]))


def _overlay(
    panels: AxesGrid,
    there: BoolArray,
    results: Sequence[StoredResult],
    failures: Sequence[Failures],
    variable: str,
) -> list[Artist]:
    """Draw the results over each other; returns what a legend shows besides their lines."""
    joints = [read_curves(result, [variable]) for result in results]
    handles: list[Artist] = []
    for joint, curve in np.argwhere(there).tolist():
        axes = panels[joint, curve]
        peaked = []
        for index, (of_result, failed) in enumerate(zip(joints, failures, strict=True)):
            curves, style = of_result[joint], line_style(index)
            handles += draw_curve(axes, curves[curve], index, style)
            calm = failed.calm(joint, curves.time)
            peaked.append(Peaked(curves.time, curves.values[curve], style.color, calm))
        if variable in GROWING:
            handles += cut_peaks(axes, peaked)
        for failed in failures:
            handles += draw_bands(axes, failed.time, *failed.among([joint]))
    return handles


class _Apart(NamedTuple):
    """What one of the results differs by from the first, of each joint, and its root mean square."""

    number: int
    joints: Sequence[Curves]
    rms: Sequence[Sequence[float]]


def _draw_differences(
    panels: AxesGrid,
    there: BoolArray,
    results: Sequence[StoredResult],
    failures: Sequence[Failures],
    compared: _Compared,
) -> list[Artist]:
    """Draw what the others differ by from the first, where they have times in common."""
    several = [(index, Difference(result, results[0])) for index, result in enumerate(results)][1:]
    apart = [
        _Apart(index, read_curves(each, [compared.variable]), _by_curve(each.rms(compared.variable)))
        for index, each in several
        if each.time.size
    ]
    handles: list[Artist] = []
    for joint, curve in np.argwhere(there).tolist():
        axes = panels[joint, curve]
        unit = results[0].declared[compared.variable].quantity.unit(results[0].joint_types[joint])
        rms = [each.rms[joint][curve] for each in apart]
        add_title(axes, _difference_words(rms, unit))
        axes.axhline(0.0, **ZERO)
        peaked = []
        for each in apart:
            curves, style = each.joints[joint], line_style(each.number)
            handles += draw_curve(axes, curves[curve], each.number, style)
            calm = failures[0].calm(joint, curves.time) & failures[each.number].calm(joint, curves.time)
            peaked.append(Peaked(curves.time, curves.values[curve], style.color, calm))
        if compared.variable in GROWING and peaked:
            handles += cut_peaks(axes, peaked)
    return handles


def _difference_words(rms: Sequence[float], unit: str) -> str:
    """The title of a panel with differences."""
    if not any(value >= 0 for value in rms):
        return "no values in common"
    return f"difference, rms {', '.join(f'{value:.3g}' for value in rms)} {unit}"


def _by_curve(rms: FloatArray) -> Sequence[Sequence[float]]:
    """(joints, curves)."""
    by_curve: list[list[float]] = rms.reshape(len(rms), -1).tolist()
    return by_curve
