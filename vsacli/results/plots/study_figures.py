"""Figures of studies: margin and cost over the parameters, the Pareto front, the probability of success.

The ranking of a sensitivity analysis has a bar for each parameter.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsacli.base.arrays import FloatArray
from vsacli.results.charts.chart import PANEL_WIDTH
from vsacli.results.charts.study_points import StudyPoints
from vsacli.results.plots.panels import ZERO, add_title
from vsacli.results.plots.sheets import complete
from vsacli.results.plots.styles import house_style, line_handle, line_style, shortened
from vsacli.results.store.study_table import StoredStudy

MARGIN, COST, PARETO, FEASIBILITY_OF_RUNS = "margin", "cost", "pareto", "feasibility"
"""Names of the figures, whose files are called `<stem>-<name>`."""

PANEL_HEIGHT = 2.4
"""Height of a panel, inches."""

MOST_LETTERS = 30
"""Longest label on one line along a panel, characters."""

MOST_PANELS = 6
"""Maximum number of parameters in one figure: those with the highest correlation to the margin."""

BAR_HEIGHT = 0.28
"""Height of a bar, inches."""

LABEL_LENGTH, ROOM_FOR_LABELS = 16, 0.35
"""Characters of a joint's name next to its bar, and the space for it, relative to the longest bar."""

_FINE, _LOST = line_style(2).color, line_style(1).color


def study_figures(table: StoredStudy) -> Mapping[str, Figure]:
    """Draw the figures of a study table, by name.

    Raises:
        InputError: there is nothing to draw.
    """
    points = StudyPoints(table)
    with house_style():
        figures = {FEASIBILITY_OF_RUNS: _feasibility([points], [points.name])}
        if points.varying:
            figures[COST if points.optimized else MARGIN] = (
                _over_map(points) if _is_grid(points) else _over_numbers(points)
            )
        if points.cost is not None and not points.optimized and len(points.front) > 1:
            figures[PARETO] = _pareto(points)
    return figures


def compared_studies(tables: Sequence[StoredStudy], labels: Sequence[str]) -> Figure:
    """Draw the distribution of margins of several studies.

    Raises:
        InputError: a study has nothing to draw.
    """
    with house_style():
        return _feasibility([StudyPoints(table) for table in tables], labels)


def _over_numbers(points: StudyPoints) -> Figure:
    """Draw margin, and cost below, over each varying parameter."""
    paths = _most_followed(points)
    rows = 1 if points.cost is None else 2
    figure = Figure((PANEL_WIDTH * max(2, len(paths)), PANEL_HEIGHT * rows + 0.9), layout="constrained")
    panels = figure.subplots(rows, len(paths), squeeze=False, sharex="col", sharey="row")
    for column, path in zip(panels.T, paths, strict=True):
        _scatter(column[0], points, points.varying[path], 100 * points.margin)
        column[0].axhline(0.0, **ZERO)
        _name_worst(column[0], points, points.varying[path])
        if points.cost is not None:
            _scatter(column[1], points, points.varying[path], points.cost[1])
        column[-1].set_xlabel(_label(points, path), parse_math=False)
    panels[0, 0].set_ylabel("smallest margin [%]")
    if points.cost is not None:
        panels[1, 0].set_ylabel(points.cost[0])
    return complete(figure, points.name, _handles(points))


def _most_followed(points: StudyPoints) -> list[str]:
    """Return the parameters with the highest correlation to the margin, in the order of the table."""
    there = np.isfinite(points.margin)

    def followed(path: str) -> float:
        values, margin = points.varying[path][there], points.margin[there]
        if len(values) < 2 or np.ptp(values) == 0 or np.ptp(margin) == 0:
            return 0.0
        return abs(float(np.corrcoef(values, margin)[0, 1]))

    chosen = sorted(points.varying, key=followed, reverse=True)[:MOST_PANELS]
    return [path for path in points.varying if path in chosen]


def _scatter(axes: Axes, points: StudyPoints, x: FloatArray, y: FloatArray) -> None:
    for rows, color, marker in ((points.feasible, _FINE, "o"), (~points.feasible, _LOST, "x")):
        axes.plot(x[rows], y[rows], linestyle="", marker=marker, color=color, markersize=3)
    axes.margins(0.06)


def _name_worst(axes: Axes, points: StudyPoints, x: FloatArray) -> None:
    for row in points.worst:
        place = (x[row], 100 * points.margin[row])
        axes.annotate(f" {points.runs[row]}", place, fontsize=8, va="center")


def _handles(points: StudyPoints) -> list[Line2D]:
    kinds = (("feasible", points.feasible, _FINE, "o"), ("infeasible", ~points.feasible, _LOST, "x"))
    return [
        Line2D([], [], linestyle="", marker=marker, color=color, label=label)
        for label, rows, color, marker in kinds
        if rows.any()
    ]


def _is_grid(points: StudyPoints) -> bool:
    """Return whether two parameters vary on a full grid: each pair of their values occurs once."""
    if len(points.varying) != 2:
        return False
    pairs = np.column_stack(list(points.varying.values()))
    sizes = [len(np.unique(values)) for values in pairs.T]
    return len(pairs) == math.prod(sizes) == len(np.unique(pairs, axis=0)) and min(sizes) > 2


def _over_map(points: StudyPoints) -> Figure:
    """Draw margin and cost, or costs before and after an optimization, as maps over two parameters."""
    (across, x), (up, y) = points.varying.items()
    maps = points.shown
    figure = Figure((1.5 * PANEL_WIDTH * len(maps), PANEL_HEIGHT + 1.2), layout="constrained")
    panels = figure.subplots(1, len(maps), squeeze=False, sharey=True)[0]
    panels[0].set_ylabel(_label(points, up), parse_math=False)
    order = np.lexsort((x, y))
    shape = (len(np.unique(y)), len(np.unique(x)))
    for axes, (label, values) in zip(panels, maps, strict=True):
        place = [each[order].reshape(shape) for each in (x, y, values)]
        shown = axes.pcolormesh(*place, shading="nearest", cmap="viridis", rasterized=True)
        axes.contour(
            place[0], place[1], 100 * points.margin[order].reshape(shape), levels=[0], colors=[_LOST]
        )
        axes.set_xlabel(_label(points, across), parse_math=False)
        axes.grid(visible=False)
        axes.set_facecolor("0.8")
        figure.colorbar(shown, ax=axes, label=_fitting(label))
    zero, none = (
        Line2D([], [], color=_LOST, label="margin zero"),
        Patch(color="0.8", label="infeasible steps"),
    )
    return complete(figure, points.name, [none] if points.optimized else [zero, none])


def _fitting(label: str) -> str:
    """Return a label with its unit, on two lines if it is longer than a panel is high."""
    return label if len(label) <= MOST_LETTERS else label.replace(" [", "\n[")


def _pareto(points: StudyPoints) -> Figure:
    """Draw cost over margin of the feasible runs, with the Pareto front."""
    assert points.cost is not None, "see study_figures"
    words, cost = points.cost
    figure = Figure((2 * PANEL_WIDTH, 1.6 * PANEL_HEIGHT), layout="constrained")
    axes = figure.add_subplot()
    rows, front = points.feasible & np.isfinite(cost), points.front
    axes.plot(100 * points.margin[rows], cost[rows], linestyle="", marker="o", color="0.6", markersize=3)
    axes.plot(100 * points.margin[front], cost[front], **line_style(2).words)
    for row in {front[0], front[len(front) // 2], front[-1]}:
        place = (100 * points.margin[row], cost[row])
        axes.annotate(f"run {points.runs[row]}", place, (4, -9), textcoords="offset points", fontsize=8)
    axes.set_xlabel("smallest margin [%]")
    axes.set_ylabel(words)
    axes.margins(0.08)
    runs = Line2D([], [], linestyle="", marker="o", color="0.6", markersize=3, label="feasible runs")
    return complete(figure, points.name, [runs, line_handle(line_style(2), "Pareto front")])


def _feasibility(studies: Sequence[StudyPoints], labels: Sequence[str]) -> Figure:
    """Draw the share of runs with at least a given margin; the legend gives the share of feasible runs."""
    figure = Figure((2 * PANEL_WIDTH, 1.6 * PANEL_HEIGHT), layout="constrained")
    axes, handles = figure.add_subplot(), []
    for index, (points, label) in enumerate(zip(studies, labels, strict=True)):
        margins, shares = points.exceedance
        style = replace(line_style(index), marker="").words
        axes.step(100 * margins, 100 * shares, where="pre", **style)
        share = "{:.3g} % ({:.3g} to {:.3g} %)".format(*(100 * each for each in points.share))
        handles.append(Line2D([], [], **style, label=f"{label}: {share}"))
    axes.axvline(0.0, **ZERO)
    axes.set_xlabel("smallest margin [%]")
    axes.set_ylabel("runs with at least this margin [%]")
    axes.set_ylim(0, 103)
    add_title(axes, "feasible runs, with 95 % intervals")
    return complete(figure, labels[0] if len(labels) == 1 else "studies", handles)


def _label(points: StudyPoints, path: str) -> str:
    """Return the axis label of a parameter."""
    unit = points.unit(path)
    return f"{shortened(path)}\n[{unit}]" if unit else shortened(path)


class Bar(NamedTuple):
    """The effect of a change of a parameter.

    Attributes:
        label: parameter and its change.
        share: largest change of a motor torque, relative to the largest torque of its joint.
        joint: joint of that motor.
    """

    label: str
    share: float
    joint: str


def ranking_figure(bars: Sequence[Bar], title: str) -> Figure:
    """Draw a bar for each parameter, the most important on top, with the joint that it affects most."""
    with house_style():
        figure = Figure((2 * PANEL_WIDTH, BAR_HEIGHT * len(bars) + 1.2), layout="constrained")
        axes = figure.add_subplot()
        joints = list(dict.fromkeys(bar.joint for bar in bars))
        colors = [line_style(joints.index(bar.joint)).color for bar in bars]
        axes.barh(range(len(bars)), [100 * bar.share for bar in bars], color=colors, height=0.7)
        axes.set_yticks(range(len(bars)), [bar.label for bar in bars], parse_math=False)
        axes.invert_yaxis()
        for place, bar in enumerate(bars):
            text = f" {shortened(bar.joint, LABEL_LENGTH)}"
            axes.text(100 * bar.share, place, text, va="center", fontsize=8, parse_math=False)
        axes.margins(x=ROOM_FOR_LABELS)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("change of motor torque [% of its peak]")
        return complete(figure, title, [])
