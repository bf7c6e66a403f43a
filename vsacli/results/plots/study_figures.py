"""Figures of studies: margin and cost over what varies, the Pareto front, how probable it is to succeed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.errors import InputError
from vsacli.results.plots.drawing import house_style, line_handle, line_style, shortened
from vsacli.results.plots.panels import PANEL_WIDTH, add_title, complete
from vsacli.results.store.stored_study import StoredStudy

MARGIN, PARETO, FEASIBILITY_OF_RUNS = "margin", "pareto", "feasibility"
"""Names of the figures; the files are called `<stem>-<name>`."""

PANEL_HEIGHT = 2.4
"""Inches."""

MOST_PANELS = 6
"""Numbers that vary whose panels one figure holds: those that the margin follows most."""

NAMED_RUNS = 3
"""The worst runs, which are named beside their points."""

NORMAL_95 = 1.96
"""Standard deviations of a normal distribution within which 95 % lie."""

COSTS = {"energy_spent": ("energy that motors spend", "J"), "peak_tau_motor": ("largest motor torque", "N m")}
"""What a study may have kept that says what a motion costs: the first of these counts."""

_FINE, _LOST = line_style(2).color, line_style(1).color


class StudyPoints:
    """What figures show of a table.

    Attributes:
        name: of the study.
        runs: numbers of the runs, (rows,).
        margin: smallest margin of all joints, (rows,), relative; NaN if a run failed.
        feasible: whether every step was feasible and regular, (rows,).

    Raises:
        InputError: the table has no margins, or no rows.
    """

    def __init__(self, table: StoredStudy) -> None:
        if "margin" not in table.columns or not table.rows:
            what = "no runs" if not table.rows else "no margin; put it into `keep:` of the study"
            raise InputError.one(f"nothing can be drawn: it has {what}", table.path)
        self.name, self.runs, self._table = table.study_name, table.read("run"), table
        self.margin = _least(table.read("margin"))
        self.feasible: BoolArray = np.isin(table.texts("verdict"), ("ok", "over_limit", "doubtful"))

    @cached_property
    def varying(self) -> dict[str, FloatArray]:
        """The numbers that are not the same in all rows, by path."""
        table = self._table
        found = {path: table.read(path) for path in table.parameters if not table.parameter_is_text(path)}
        return {path: values for path, values in found.items() if np.ptp(values) > 0}

    @cached_property
    def cost(self) -> tuple[str, FloatArray] | None:
        """The words for the cost, and that of each run, NaN if steps are without; None if none was kept."""
        for name, (words, unit) in COSTS.items():
            if name in self._table.columns:
                values = self._table.read(name)
                total = values.sum(axis=1) if values.ndim == 2 else _most(values)
                return f"{words} [{unit}]", total
        return None

    def label(self, path: str) -> str:
        """The label of an axis with a number."""
        unit = self._table.unit(path)
        return f"{shortened(path)}\n[{unit}]" if unit not in ("", "1") else shortened(path)

    @property
    def worst(self) -> IndexArray:
        """The rows with the smallest margins."""
        order = np.argsort(np.where(np.isnan(self.margin), np.inf, self.margin), kind="stable")
        return order[: min(NAMED_RUNS, int(np.isfinite(self.margin).sum()))]

    @property
    def front(self) -> IndexArray:
        """Feasible rows with less cost than any with a larger margin, the least margin first."""
        assert self.cost is not None, "see study_figures"
        rows = np.flatnonzero(self.feasible & np.isfinite(self.cost[1]) & np.isfinite(self.margin))
        rows = rows[np.lexsort((self.cost[1][rows], -self.margin[rows]))]
        cost = self.cost[1][rows]
        before = np.concatenate([[np.inf], np.minimum.accumulate(cost)[:-1]])
        return rows[cost < before][::-1]


def _least(margins: FloatArray) -> FloatArray:
    """Over joints; those without a corridor have none."""
    least: FloatArray = np.where(np.isnan(margins), np.inf, margins).min(axis=1)
    return np.where(np.isinf(least), np.nan, least)


def _most(peaks: FloatArray) -> FloatArray:
    """Over joints and motors; NaN of a second motor that is not there does not count."""
    peaks = peaks.reshape(len(peaks), -1)
    there = ~np.isnan(peaks).all(axis=0)
    most: FloatArray = peaks[:, there].max(axis=1, initial=-math.inf)
    return most


def study_figures(table: StoredStudy) -> Mapping[str, Figure]:
    """The figures of the table of a study, by name.

    Raises:
        InputError: there is nothing to draw.
    """
    points = StudyPoints(table)
    with house_style():
        figures = {FEASIBILITY_OF_RUNS: _feasibility([points], [points.name])}
        if points.varying:
            figures[MARGIN] = _over_map(points) if _is_grid(points) else _over_numbers(points)
        if points.cost is not None and len(points.front) > 1:
            figures[PARETO] = _pareto(points)
    return figures


def compared_studies(tables: Sequence[StoredStudy], labels: Sequence[str]) -> Figure:
    """How probable each margin is in several studies.

    Raises:
        InputError: there is nothing to draw in one.
    """
    with house_style():
        return _feasibility([StudyPoints(table) for table in tables], labels)


def _over_numbers(points: StudyPoints) -> Figure:
    """Margin, and cost below, over each number that varies."""
    paths = _most_followed(points)
    rows = 1 if points.cost is None else 2
    figure = Figure((PANEL_WIDTH * max(2, len(paths)), PANEL_HEIGHT * rows + 0.9), layout="constrained")
    panels = figure.subplots(rows, len(paths), squeeze=False, sharex="col", sharey="row")
    for column, path in zip(panels.T, paths, strict=True):
        _scatter(column[0], points, points.varying[path], 100 * points.margin)
        column[0].axhline(0.0, color="0.4", linewidth=0.8)
        _name_worst(column[0], points, points.varying[path])
        if points.cost is not None:
            _scatter(column[1], points, points.varying[path], points.cost[1])
        column[-1].set_xlabel(points.label(path), parse_math=False)
    panels[0, 0].set_ylabel("smallest margin [%]")
    if points.cost is not None:
        panels[1, 0].set_ylabel(points.cost[0])
    return complete(figure, points.name, _handles(points))


def _most_followed(points: StudyPoints) -> list[str]:
    """The numbers that the margin follows most, by their correlation, in the order of the table."""
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
    """Whether two numbers vary, each value of one combined once with each of the other."""
    if len(points.varying) != 2:
        return False
    pairs = np.column_stack(list(points.varying.values()))
    sizes = [len(np.unique(values)) for values in pairs.T]
    return len(pairs) == math.prod(sizes) == len(np.unique(pairs, axis=0)) and min(sizes) > 2


def _over_map(points: StudyPoints) -> Figure:
    """Margin, and cost beside it, as maps over two numbers."""
    (across, x), (up, y) = points.varying.items()
    maps = [("smallest margin [%]", 100 * points.margin)] + ([points.cost] if points.cost is not None else [])
    figure = Figure((1.5 * PANEL_WIDTH * len(maps), PANEL_HEIGHT + 1.2), layout="constrained")
    panels = figure.subplots(1, len(maps), squeeze=False, sharey=True)[0]
    panels[0].set_ylabel(points.label(up), parse_math=False)
    order = np.lexsort((x, y))
    shape = (len(np.unique(y)), len(np.unique(x)))
    for axes, (label, values) in zip(panels, maps, strict=True):
        place = [each[order].reshape(shape) for each in (x, y, values)]
        shown = axes.pcolormesh(*place, shading="nearest", cmap="viridis", rasterized=True)
        axes.contour(
            place[0], place[1], 100 * points.margin[order].reshape(shape), levels=[0], colors=[_LOST]
        )
        axes.set_xlabel(points.label(across), parse_math=False)
        axes.grid(visible=False)
        axes.set_facecolor("0.8")
        figure.colorbar(shown, ax=axes, label=label)
    handles = [Line2D([], [], color=_LOST, label="margin zero"), Patch(color="0.8", label="infeasible steps")]
    return complete(figure, points.name, handles)


def _pareto(points: StudyPoints) -> Figure:
    """Cost over margin of the feasible runs, and those of which none is better in both."""
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
    """Share of the runs whose smallest margin is at least so large, and of those that are feasible."""
    figure = Figure((2 * PANEL_WIDTH, 1.6 * PANEL_HEIGHT), layout="constrained")
    axes, handles = figure.add_subplot(), []
    for index, (points, label) in enumerate(zip(studies, labels, strict=True)):
        margins = np.sort(points.margin[np.isfinite(points.margin)])
        shares = 100 * np.arange(len(margins), 0, -1) / len(points.margin)
        style = replace(line_style(index), marker="").words
        axes.step(100 * margins, shares, where="pre", **style)
        handles.append(Line2D([], [], **style, label=_share(points, label)))
    axes.axvline(0.0, color="0.4", linewidth=0.8)
    axes.set_xlabel("smallest margin [%]")
    axes.set_ylabel("runs with at least this margin [%]")
    axes.set_ylim(0, 103)
    add_title(axes, "feasible runs, with 95 % intervals")
    return complete(figure, labels[0] if len(labels) == 1 else "studies", handles)


def _share(points: StudyPoints, label: str) -> str:
    """How many runs are feasible, with the interval that 95 of 100 such studies would have (Wilson 1927)."""
    count, feasible = len(points.feasible), int(points.feasible.sum())
    share, square = feasible / count, NORMAL_95**2
    centre = (share + square / (2 * count)) / (1 + square / count)
    half = NORMAL_95 * math.sqrt(share * (1 - share) / count + square / (4 * count**2)) / (1 + square / count)
    low, high = max(0.0, centre - half), min(1.0, centre + half)
    return f"{label}: {100 * share:.3g} % ({100 * low:.3g} to {100 * high:.3g} %)"
