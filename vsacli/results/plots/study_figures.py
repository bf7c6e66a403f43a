"""Figures of studies: margin and cost over the parameters, the Pareto front, the probability of success.

The ranking of a sensitivity analysis has a bar for each parameter.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.texts import counted
from vsacli.results.charts.chart import PANEL_WIDTH
from vsacli.results.charts.look import CM_PER_INCH, current_look
from vsacli.results.charts.ranking import Ranking
from vsacli.results.charts.study_points import OK, StudyPoints, verdict_label
from vsacli.results.plots.arrangement import columns_of_panels
from vsacli.results.plots.long_texts import wrapped
from vsacli.results.plots.panels import ZERO
from vsacli.results.plots.point_labels import LETTER_WIDTH, SIDES_BELOW_LINE, label_points
from vsacli.results.plots.sheets import AxesGrid, complete
from vsacli.results.plots.styles import (
    LONGEST_LABEL,
    line_handle,
    line_style,
    new_figure,
    scaled,
    shortened,
)
from vsacli.results.store.study_table import StoredStudy

MARGIN, COST, PARETO, FEASIBILITY_OF_RUNS = "margin", "cost", "pareto", "feasibility"
"""Names of the figures, whose files are called `<stem>-<name>`."""

PANEL_HEIGHT, LOW_HEIGHT = 2.4, 1.8
"""Height of a panel, and of each of several rows of parameters, inches."""

MOST_LETTERS = 30
"""Longest line of a label along a panel, characters."""

MOST_PANELS = 6
"""Maximum number of parameters in one figure: those with the highest correlation to the margin."""

LINE_HEIGHT = 0.2
"""Height of a line of a legend, inches."""

MAP_WIDTH = 1.5 * PANEL_WIDTH
"""Width of a map with its color bar, inches."""

BAR_HEIGHT, HIGH_BAR = 0.28, 0.37
"""Height of a bar, and of one whose label has two lines, inches."""

LABEL_LENGTH, LABEL_SIZE, ROOM_FOR_LABELS = 16, 8, 0.35
"""Characters of the name of a joint next to its bar, its size at the usual font size in points, and the space
for it, relative to the longest bar."""

MOST_TICKS = 8
"""Maximum number of values of a grid that are ticks of a map; of more, some are."""

ROOM_FOR_RUNS = 0.13
"""Space around a Pareto front for the labels of its ends, relative to its size."""

NO_BREAK = "\N{NO-BREAK SPACE}"

_POINT: dict[str, Any] = {"linestyle": "", "markersize": 3}
_OK: dict[str, Any] = {**_POINT, "marker": "o", "color": line_style(2).color}
_MARKS: dict[str, dict[str, Any]] = {
    OK: _OK,
    "over_limit": {**_POINT, "marker": "^", "markersize": 4, "color": line_style(4).color},
    "singular": {**_POINT, "marker": "D", "color": line_style(5).color},
    "infeasible": {**_POINT, "marker": "x", "markersize": 4, "color": line_style(1).color},
    "unreliable": {**_POINT, "marker": "s", "color": line_style(3).color},
}
"""Marks of runs by verdict."""
_BEFORE: dict[str, Any] = {
    **_POINT,
    "marker": "o",
    "markersize": 4,
    "color": line_style(1).color,
    "markerfacecolor": "none",
}
_OTHER: dict[str, Any] = {**_POINT, "marker": "+", "markersize": 4, "color": "0.4"}
_PALE: dict[str, Any] = {"alpha": 0.3}
_OF_ALL: dict[str, Any] = {"linestyle": ":", "linewidth": 1.2}
_NAMED: dict[str, Any] = {"linestyle": "", "marker": r"$\mathrm{7}$", "color": "black", "markersize": 6}
_BOUNDARY: dict[str, Any] = {
    "color": "black",
    "path_effects": [withStroke(linewidth=3.5, foreground="white")],
}
_NOTHING: dict[str, Any] = {"facecolor": "0.9", "edgecolor": "0.6", "linewidth": 0, "hatch": "////"}
_INTERVAL: dict[str, Any] = {"alpha": 0.2, "linewidth": 0}


def study_figures(table: StoredStudy) -> Mapping[str, Figure]:
    """Draw the figures of a study table, by name.

    Raises:
        InputError: there is nothing to draw.
    """
    points = StudyPoints(table)
    figures = {FEASIBILITY_OF_RUNS: _feasibility([points], [""], points.title)}
    if points.varying:
        figures[COST if points.optimized else MARGIN] = (
            _parameter_maps(points) if _is_grid(points) else _parameter_panels(points)
        )
    if points.cost is not None and not points.optimized and len(points.front) > 1:
        figures[PARETO] = _pareto(points)
    return figures


def compared_studies(tables: Sequence[StoredStudy], labels: Sequence[str]) -> Figure:
    """Draw the distribution of margins of several studies.

    Raises:
        InputError: a study has nothing to draw.
    """
    title = f"comparison of {counted(len(tables), 'study', 'studies')}: ok runs"
    return _feasibility([StudyPoints(table) for table in tables], labels, title)


def _parameter_panels(points: StudyPoints) -> Figure:
    """Draw margin, and cost below, over each varying parameter; of optimized runs the costs alone."""
    paths = _most_correlated(points)
    rows = 1 if points.cost is None or points.optimized else 2

    def natural(columns: int) -> tuple[float, float]:
        groups = math.ceil(len(paths) / columns)
        height = PANEL_HEIGHT if groups == 1 else LOW_HEIGHT
        return PANEL_WIDTH * max(2, columns), height * rows * groups + 0.9

    columns = min(len(paths), columns_of_panels(len(paths), natural))
    handles: list[Artist] = []
    with new_figure(natural(columns)) as figure:
        panels = _panel_columns(figure, len(paths), rows, columns)
        for column, path in zip(panels, paths, strict=True):
            if not points.optimized:
                handles += _margins_over(column[0], points, points.varying[path])
            if points.cost is not None:
                handles += _costs_over(column[-1], points, points.varying[path])
            column[-1].set_xlabel(
                _label(points, path, MOST_LETTERS * (2 if len(paths) == 1 else 1)), parse_math=False
            )
        for column in panels[::columns]:
            if points.cost is not None:
                column[-1].set_ylabel(_wrapped_label(points.cost_words))
            if not points.optimized:
                column[0].set_ylabel("smallest margin [%]")
        complete(figure, points.title, handles)
        if not points.optimized:
            for column, path in zip(panels, paths, strict=True):
                _name_worst(column[0], points, points.varying[path])
        return figure


def _panel_columns(figure: Figure, count: int, rows: int, columns: int) -> AxesGrid:
    """Return panels (count, rows): in each, x is shared from top to bottom; y is shared by all of a kind."""
    groups = math.ceil(count / columns)
    grid = figure.subplots(groups * rows, columns, squeeze=False).reshape(groups, rows, columns)
    panels = grid.swapaxes(1, 2).reshape(-1, rows)
    for unused in panels[count:].flat:
        unused.remove()
    for column_index, column in enumerate(panels[:count]):
        for row, axes in enumerate(column):
            if column_index:
                axes.sharey(panels[0, row])
            if column_index % columns:
                axes.tick_params(labelleft=False)
            if row < rows - 1:
                axes.sharex(column[-1])
                axes.tick_params(labelbottom=False)
    return panels[:count]


def _most_correlated(points: StudyPoints) -> list[str]:
    """Return the parameters most correlated to the margin, or to the cost of optima, in the table's order."""
    criterion = points.cost[1] if points.optimized and points.cost is not None else points.margin
    finite = np.isfinite(criterion)

    def correlation(path: str) -> float:
        values, finite_criterion = points.varying[path][finite], criterion[finite]
        if len(values) < 2 or np.ptp(values) == 0 or np.ptp(finite_criterion) == 0:
            return 0.0
        return abs(float(np.corrcoef(values, finite_criterion)[0, 1]))

    most_correlated = sorted(points.varying, key=correlation, reverse=True)[:MOST_PANELS]
    return [path for path in points.varying if path in most_correlated]


def _margins_over(axes: Axes, points: StudyPoints, x: FloatArray) -> Iterator[Artist]:
    """Draw margins; yield legend entries."""
    margin = 100 * points.margin
    yield from _runs_by_verdict(axes, points, x, margin)
    axes.axhline(0.0, **scaled(ZERO))
    if points.worst.size:
        yield Line2D([], [], **scaled(_NAMED), label="runs of the smallest margins")


def _name_worst(axes: Axes, points: StudyPoints, x: FloatArray) -> None:
    """Write the numbers of the runs with the smallest margins."""
    positions = [(float(x[row]), float(100 * points.margin[row])) for row in points.worst]
    label_points(axes, positions, [str(points.runs[row]) for row in points.worst])


def _costs_over(axes: Axes, points: StudyPoints, x: FloatArray) -> Iterator[Artist]:
    """Draw the costs of all runs, or before and after their optimization; yield legend entries."""
    assert points.cost is not None, "see _parameter_panels"
    cost, all_runs = points.cost[1], np.ones(len(x), dtype=np.bool_)
    if points.optimized:
        costs_before = points.cost_before[1]
        yield from _scatter(
            axes, x, costs_before, all_runs, _label_with_count("as commanded", costs_before), _BEFORE
        )
        yield from _scatter(axes, x, cost, all_runs, _label_with_count("optimum", cost), _OK)
    else:
        yield from _runs_by_verdict(axes, points, x, cost)


def _runs_by_verdict(
    axes: Axes, points: StudyPoints, x: FloatArray, y: FloatArray, **not_ok_style: float
) -> Iterator[Artist]:
    """Draw runs with the marks of their verdicts, those that are not ok with further keywords."""
    for verdict in points.counts:
        style = {**_MARKS.get(verdict, _OTHER), **(not_ok_style if verdict != OK else {})}
        yield from _scatter(axes, x, y, points.has_verdict(verdict), verdict_label(verdict), style)


def _label_with_count(label: str, costs: FloatArray) -> str:
    """Return a label, with the number of runs that have a cost unless all have one."""
    finite_count = int(np.isfinite(costs).sum())
    return label if finite_count == len(costs) else f"{label} ({finite_count} of {len(costs)} feasible)"


def _scatter(
    axes: Axes, x: FloatArray, y: FloatArray, mask: BoolArray, label: str, style: Mapping[str, Any]
) -> Iterator[Artist]:
    """Draw the chosen points that have a value; yield their legend entry if there are any."""
    rows = mask & np.isfinite(y)
    axes.plot(x[rows], y[rows], **scaled(style))
    axes.margins(0.08)
    if rows.any():
        yield Line2D([], [], **scaled({**style, "markersize": 5}), label=label)


def _is_grid(points: StudyPoints) -> bool:
    """Return whether two parameters vary on a full grid: each pair of their values occurs once."""
    if len(points.varying) != 2:
        return False
    pairs = np.column_stack(list(points.varying.values()))
    counts = [len(np.unique(values)) for values in pairs.T]
    return len(pairs) == math.prod(counts) == len(np.unique(pairs, axis=0)) and min(counts) > 2


def _parameter_maps(points: StudyPoints) -> Figure:
    """Draw margin and cost, or costs before and after an optimization, as maps over two parameters."""
    (x_path, x), (y_path, y) = points.varying.items()
    maps = points.drawn_columns

    def natural(columns: int) -> tuple[float, float]:
        return MAP_WIDTH * columns, (PANEL_HEIGHT + 0.5) * math.ceil(len(maps) / columns) + 0.7

    columns = min(len(maps), columns_of_panels(len(maps), natural, MAP_WIDTH - 1))
    order, shape = np.lexsort((x, y)), (len(np.unique(y)), len(np.unique(x)))
    margin = points.margin[order].reshape(shape)
    bounded = not points.optimized and np.nanmin(margin, initial=0.0) < 0 < np.nanmax(margin, initial=0.0)
    mark_handles: list[Artist] = []
    with new_figure(natural(columns)) as figure:
        panels = figure.subplots(math.ceil(len(maps) / columns), columns, squeeze=False, sharey=True)
        for axes in panels[:, 0]:
            axes.set_ylabel(_label(points, y_path, MOST_LETTERS), parse_math=False)
        for axes, (label, values) in zip(panels.flat, maps, strict=True):
            coordinates = [array[order].reshape(shape) for array in (x, y, values)]
            _draw_map(axes, coordinates, margin if bounded else None, label)
            mark_handles += _marks_on_map(axes, points, (x, y), values)
            axes.set_xlabel(_label(points, x_path, MOST_LETTERS), parse_math=False)
        handles: list[Artist] = [Line2D([], [], **_BOUNDARY, label="margin zero")] if bounded else []
        empty: BoolArray = np.any([np.isnan(values) for _, values in maps], axis=0)
        if empty.any():
            handles.append(Patch(**_NOTHING, label=_words_without_value(points, empty)))
        return complete(figure, points.title, [*handles, *mark_handles])


def _words_without_value(points: StudyPoints, empty: BoolArray) -> str:
    """Return the verdicts of runs without a value; the commanded motions of optima have none of their own."""
    verdicts = dict.fromkeys(points.verdicts[row] for row in np.flatnonzero(empty))
    return " or ".join(verdict_label(verdict) for verdict in verdicts if verdict != OK) or "infeasible"


def _marks_on_map(
    axes: Axes, points: StudyPoints, coordinates: tuple[FloatArray, FloatArray], values: FloatArray
) -> Iterator[Artist]:
    """Mark the runs whose value does not show that they are not ok, as the margin of infeasible ones does."""
    for verdict in points.counts.keys() - {OK, "infeasible"}:
        rows = points.has_verdict(verdict) & np.isfinite(values)
        style = {**_MARKS.get(verdict, _OTHER), "color": "black", "markerfacecolor": "white"}
        yield from _scatter(axes, *coordinates, rows, verdict_label(verdict), style)


def _draw_map(axes: Axes, coordinates: Sequence[FloatArray], margin: FloatArray | None, label: str) -> None:
    """Draw values over two parameters as colors.

    Args:
        axes: panel to draw into.
        coordinates: both parameters and the values, (rows, columns) each.
        margin: margins, whose zero is drawn as a line; None for no line.
        label: label of the values.
    """
    mesh = axes.pcolormesh(*coordinates, shading="nearest", cmap="viridis", rasterized=True)
    if margin is not None:
        boundary = axes.contour(*coordinates[:2], margin, levels=[0], colors=[_BOUNDARY["color"]])
        boundary.set_path_effects(_BOUNDARY["path_effects"])
    for axis, ticks in ((axes.xaxis, np.unique(coordinates[0])), (axes.yaxis, np.unique(coordinates[1]))):
        if len(ticks) <= MOST_TICKS:
            axis.set_ticks(ticks)
    axes.grid(visible=False)
    axes.patch.set(**_NOTHING)
    axes.figure.colorbar(mesh, ax=axes, label=_wrapped_label(label))


def _wrapped_label(label: str, length: int = MOST_LETTERS) -> str:
    """Return a label with its unit in lines of limited length; the unit is not divided."""
    words, unit = label.rsplit(" [", 1) if label.endswith("]") else (label, "")
    unbroken = f"{words} [{unit.replace(' ', NO_BREAK)}" if unit else words
    return "\n".join(textwrap.wrap(unbroken, length)).replace(NO_BREAK, " ")


def _pareto(points: StudyPoints) -> Figure:
    """Draw cost over margin, with the Pareto front of the ok runs; other runs are pale."""
    assert points.cost is not None, "see study_figures"
    cost_label, cost = points.cost
    with new_figure((2 * PANEL_WIDTH, 1.6 * PANEL_HEIGHT)) as figure:
        axes = figure.add_subplot()
        margin, front = 100 * points.margin, points.front
        runs = list(_runs_by_verdict(axes, points, margin, cost, **_PALE))
        axes.plot(margin[front], cost[front], **line_style(2).line_kwargs)
        axes.margins(ROOM_FOR_RUNS)
        axes.set_xlabel("smallest margin [%]")
        axes.set_ylabel(_wrapped_label(cost_label))
        complete(figure, points.title, [*runs, line_handle(line_style(2), "Pareto front")])
        named_rows = list(dict.fromkeys([front[0], front[-1], front[len(front) // 2]]))
        positions = [(float(margin[row]), float(cost[row])) for row in named_rows]
        label_points(axes, positions, [f"run {points.runs[row]}" for row in named_rows], SIDES_BELOW_LINE)
        return figure


def _feasibility(studies: Sequence[StudyPoints], labels: Sequence[str], title: str) -> Figure:
    """Draw the share of ok runs with at least a given margin; the legend gives the share of each verdict.

    Where not all runs are ok, a dotted line is the share of all of them with this margin. Shares of random
    draws estimate probabilities, and have a band of their 95 % intervals; shares of a grid have none, since
    its runs are chosen.
    """
    line_count = sum(len(points.shares_lines) for points in studies)
    with new_figure((2 * PANEL_WIDTH, 1.5 * PANEL_HEIGHT + LINE_HEIGHT * line_count)) as figure:
        axes, handles = figure.add_subplot(), []
        for index, (points, label) in enumerate(zip(studies, labels, strict=True)):
            style = replace(line_style(index), marker="")
            _draw_shares(axes, points, style.line_kwargs)
            handles.append(line_handle(style, _lines_of_study(points, label)))
        if not all(points.ok.all() for points in studies):
            handles.append(Line2D([], [], color="black", **scaled(_OF_ALL), label="runs of any verdict"))
        if any(points.random for points in studies):
            handles.append(Patch(facecolor="0.3", **_INTERVAL, label="95 % interval (random samples)"))
        axes.axvline(0.0, **scaled(ZERO))
        axes.set_xlabel("smallest margin [%]")
        axes.set_ylabel(_wrapped_label("ok runs with at least this margin [%]"))
        axes.set_ylim(0, 103)
        return complete(figure, title, handles)


def _lines_of_study(points: StudyPoints, label: str) -> str:
    """Return the shares of verdicts for the legend, with the label of the study unless it is empty."""
    ok, *others = points.shares_lines
    labeled_share = f"{label}: {ok}"
    first_lines = (
        [ok] if not label else [labeled_share] if len(labeled_share) <= LONGEST_LABEL else [label, ok]
    )
    return "\n".join([*first_lines, *others])


def _draw_shares(axes: Axes, points: StudyPoints, style: Mapping[str, Any]) -> None:
    """Draw the share of ok runs over the margin, with its interval, and that of all runs if it differs."""
    margins, shares = points.exceedance(points.ok)
    axes.step(100 * margins, 100 * shares.values, where="pre", **style)
    if points.random:
        band_style = {"color": style["color"], **_INTERVAL}
        axes.fill_between(100 * margins, 100 * shares.low, 100 * shares.high, step="pre", **band_style)
    if not points.ok.all():
        margins, shares = points.exceedance(np.ones_like(points.ok))
        dotted_style = {**style, **scaled(_OF_ALL)}
        axes.step(100 * margins, 100 * shares.values, where="pre", **dotted_style)


def _label(points: StudyPoints, path: str, length: int) -> str:
    """Return the axis label of a parameter, in lines of limited length."""
    unit = points.unit(path)
    words = shortened(points.words(path), 2 * MOST_LETTERS)
    return _wrapped_label(f"{words} [{unit}]" if unit else words, length)


def ranking_figure(ranking: Ranking) -> Figure:
    """Draw a bar for each parameter, the most important on top, with the joint that it affects most."""
    bars = ranking.bars
    labels = [_wrapped_bar_label(bar.label) for bar in bars]
    height = HIGH_BAR if any("\n" in label for label in labels) else BAR_HEIGHT
    with new_figure((2 * PANEL_WIDTH, height * len(bars) + 1.2)) as figure:
        axes, size = figure.add_subplot(), current_look().points(LABEL_SIZE)
        joints = list(dict.fromkeys(bar.joint for bar in bars))
        colors = [line_style(joints.index(bar.joint)).color for bar in bars]
        axes.barh(range(len(bars)), [100 * bar.share for bar in bars], color=colors, height=0.7)
        axes.set_yticks(range(len(bars)), labels, parse_math=False)
        axes.invert_yaxis()
        for index, bar in enumerate(bars):
            text = f" {shortened(bar.joint, LABEL_LENGTH)}"
            axes.text(100 * bar.share, index, text, va="center", fontsize=size, parse_math=False)
        axes.margins(x=ROOM_FOR_LABELS)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("change of motor torque [% of its peak]")
        return complete(figure, ranking.title, [])


def _wrapped_bar_label(label: str) -> str:
    """Return the label of a bar, in lines of half the width of the figure if that alone is fixed."""
    look = current_look()
    if look.width is None or look.height is not None:
        return label
    return wrapped(label, int(look.width / CM_PER_INCH / 2 / (LETTER_WIDTH * look.scale)))
