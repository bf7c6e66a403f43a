"""Several files of a kind on the same axes, with their differences from the first file below.

Files can be compared if they are of one kind and have the same joints. By default, results are compared by
their motor torques and simulations by their position errors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vsacli.base.errors import InputError
from vsacli.base.texts import counted, one_line
from vsacli.results.charts.chart import PANEL_WIDTH, Chart, PanelGrid, Row, Sheet
from vsacli.results.charts.figures import (
    axis_label,
    drawable_variables,
    missing_variables,
    variable_words,
)
from vsacli.results.charts.reduction import GROWING
from vsacli.results.charts.stored import StoredCharts, StoredSignals, flat_range
from vsacli.results.store.reader import StoredResult


def check_comparable(files: Sequence[StoredResult]) -> None:
    """Refuse files that cannot share axes.

    Raises:
        InputError: the files are of different kinds, or have different joints.
    """
    if len({file.kind for file in files}) > 1:
        kinds_text = ", ".join(f"{file.path} is a {file.kind}" for file in files)
        raise InputError.one(f"{kinds_text}; compare results with results, and simulations with simulations")
    first = files[0]
    for file in files[1:]:
        if _joints_text(file) != _joints_text(first):
            message = (
                f"cannot be compared with {first.path}: it has the joints {_joints_text(file)}, "
                f"the other has {_joints_text(first)}; compare results of the same robot"
            )
            raise InputError.one(message, file.path)


def _joints_text(result: StoredResult) -> str:
    pairs = zip(result.joint_names, result.joint_types, strict=True)
    return ", ".join(f"{name} ({joint_type})" for name, joint_type in pairs)


def distinct_labels(results: Sequence[StoredResult]) -> list[str]:
    """Return trajectory names; if some are equal, with the stem or the path of each file."""
    for label in _LABELS:
        labels = [label(result) for result in results]
        if len(set(labels)) == len(labels):
            return labels
    return [f"{number}: {label}" for number, label in enumerate(labels, start=1)]


_LABELS: tuple[Callable[[StoredResult], str], ...] = (
    lambda result: result.trajectory_name,
    lambda result: f"{result.trajectory_name} ({one_line(Path(result.path).stem)})",
    lambda result: f"{result.trajectory_name} ({one_line(str(result.path))})",
)


COMPARISON = "compare"
"""Name of the figure, whose file is called `<stem>-compare`."""

MOST_ROWS = 7
HEIGHTS = (1.6, 0.9)
"""Heights of a panel and of the panel with the differences below it, inches."""


class _ComparedVariable(NamedTuple):
    """A variable to compare, its words in the figure's title, and the label of its axes."""

    variable: str
    title: str
    words: str


_DEFAULT_VARIABLES = {
    "result": _ComparedVariable("tau_motor", "motor torques", r"$\tau_{motor}$"),
    "simulation": _ComparedVariable("q_error", "position errors", "$q - q_d$"),
}
"""Variables compared by default; for results as in Fig. 4 of Buondonno & De Luca (2016)."""


def comparison_names(variables: Sequence[str] | None) -> list[str]:
    """Return the names of the figures that compare these variables, or of the default figure."""
    return [COMPARISON] if variables is None else [f"{COMPARISON}-{variable}" for variable in variables]


def comparison_sheets(
    files: Sequence[StoredResult], variables: Sequence[str] | None = None
) -> Iterator[tuple[str, Sheet]]:
    """Overlay results, or simulations, of the same joints: a row of panels per joint, a column per curve.

    Args:
        files: open files, all of one kind.
        variables: names of the variables to compare; the default depends on the kind.

    Returns:
        The figures by name, see `comparison_names`.

    Raises:
        InputError: the files are of different kinds or have different joints, or a file was written without a
            variable to compare.
    """
    check_comparable(files)
    if variables is None:
        compared_variables = [_DEFAULT_VARIABLES[files[0].kind]]
    else:
        for file in files:
            drawable = drawable_variables(file, variables)
        compared_variables = [
            _ComparedVariable(compared.name, compared.long_name, variable_words(compared))
            for compared in drawable
        ]
    for file in files:
        missing = [
            compared.variable for compared in compared_variables if compared.variable not in file.variables
        ]
        if missing:
            raise InputError.one(missing_variables(COMPARISON, missing), file.path)
    names = comparison_names(
        None if variables is None else [compared.variable for compared in compared_variables]
    )
    charts = StoredCharts(files)
    return (
        (name, _comparison(charts, compared))
        for name, compared in zip(names, compared_variables, strict=True)
    )


def _comparison(charts: StoredCharts, compared: _ComparedVariable) -> Sheet:
    """Return the curves of all files for each joint, with their differences from the first file below."""
    existing = charts.existing(charts.first.declared[compared.variable])
    existing = existing[:, : int(np.count_nonzero(np.any(existing, axis=0)))]
    signals = charts.signals({compared.variable: "computed"}, uncertain=False)
    differences = charts.differences(compared.variable)
    rows: list[Row] = []
    for joint, joint_mask in enumerate(existing):
        panels = (
            (
                _overlay_chart(charts, compared, signals, joint, column),
                _difference_chart(charts, compared, signals, differences, joint, column),
            )
            if exists
            else (None, None)
            for column, exists in enumerate(joint_mask)
        )
        rows += zip(*panels, strict=True)
    time = np.sort(np.concatenate([file.time[[0, -1]] for file in charts.files]))
    block = PanelGrid(time, rows, HEIGHTS, MOST_ROWS)
    size = (max(2, block.columns) * PANEL_WIDTH, block.height + 1.2)
    robots = " / ".join(dict.fromkeys(file.robot_name for file in charts.files))
    legend = {label: number for number, label in enumerate(distinct_labels(charts.files))}
    files = counted(len(charts.files), charts.first.kind)
    return Sheet(f"comparison of {files} of {robots}: {compared.title}", size, legend, [block])


def _overlay_chart(
    charts: StoredCharts, compared: _ComparedVariable, signals: StoredSignals, joint: int, column: int
) -> Chart:
    first, has_motors = charts.first, "motor" in charts.first.declared[compared.variable].dims
    chart = charts.chart(compared.variable, signals, column, [joint], "file")
    return replace(
        chart,
        title=first.joint_names[joint] + (f", motor {column + 1}" if has_motors else ""),
        axis=axis_label(compared.words, chart.unit, first.joint_types[joint], column),
        limits=(),
        failures=[(failures, [joint]) for failures in charts.failures],
    )


def _difference_chart(
    charts: StoredCharts,
    compared: _ComparedVariable,
    signals: StoredSignals,
    differences: StoredSignals,
    joint: int,
    column: int,
) -> Chart:
    lines = differences.lines(column, [joint], "file")
    unit = charts.first.declared[compared.variable].quantity.unit(charts.first.joint_types[joint])
    rms = [line.rms for line in lines if line.rms is not None]
    if not any(value >= 0 for value in rms):
        return Chart("no values in common", "", lines, zero=True)
    if (flat_limits := flat_range(lines, signals.lines(column, [joint], "file"))) is not None:
        title = f"equal to the first, rms {max(rms):.1g} {unit}" if any(rms) else "equal to the first"
        return Chart(title, "", lines, shown=flat_limits, zero=True)
    title = f"minus the first, rms {', '.join(f'{value:.3g}' for value in rms)} {unit}"
    y_limits = charts.calm(lines, 0) if compared.variable in GROWING and lines else None
    return Chart(title, "", lines, shown=y_limits, cut_off=y_limits is not None, zero=True)
