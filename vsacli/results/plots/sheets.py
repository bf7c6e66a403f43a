"""Sheets as figures: panels in rows and columns with common time axes, one legend and a title."""

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

from vsacli.base.arrays import FloatArray
from vsacli.base.units import TIME
from vsacli.results.charts import chart as charts
from vsacli.results.charts.chart import PanelGrid, Sheet
from vsacli.results.charts.look import current_look
from vsacli.results.plots.arrangement import arranged
from vsacli.results.plots.long_texts import LINE, broken, fit_texts
from vsacli.results.plots.panels import draw_chart
from vsacli.results.plots.styles import line_handle, line_style, make_legible, new_figure, shortened

LATE = 1e5
"""Start time, s, from which ticks count from the start, since their digits would not fit side by side."""

FINE, FEW_TICKS = 0.1, 4
"""Time span, s, below which the digits of more than `FEW_TICKS` ticks would not fit side by side."""

TITLE_LENGTH, LABEL_BESIDE = 70, 16
"""Maximum length of a title, and of a name next to a panel, characters."""

TITLE_CHARACTER = 0.095
"""Width of a character of a title at the usual font size, inches."""

ROWS_OF_LEGEND = 2
"""Number of rows of a legend for which figures of a fixed width have room."""

_INCHES_PER_CHARACTER = 0.07
_INCHES_PER_HANDLE = 0.7

AxesGrid = npt.NDArray[Any]
"""Panels in rows and columns."""


def drawn(sheet: Sheet) -> Figure:
    """Draw a sheet as a figure."""
    arrangement = arranged(sheet)
    with new_figure(arrangement.natural) as figure:
        if arrangement.stacked:
            places = figure.add_gridspec(len(arrangement.blocks), 1, height_ratios=arrangement.shares)
        else:
            places = figure.add_gridspec(1, len(arrangement.blocks), width_ratios=arrangement.shares)
        handles = line_handles(sheet.legend)
        for place, block in enumerate(arrangement.blocks):
            handles += _draw_block(places[place], block)
        return complete(figure, sheet.title, handles)


def line_handles(lines: charts.Legend) -> list[Artist]:
    """Return the legend entries of lines."""
    return [line_handle(line_style(look), label) for label, look in lines.items()]


def _draw_block(place: SubplotSpec, block: PanelGrid) -> list[Artist]:
    """Draw the charts of a block; return the legend entries besides those of the lines."""
    handles: list[Artist] = []
    panels = _panels(place, block)
    for of_row, row in zip(panels, block.rows, strict=True):
        for axes, chart in zip(of_row, row, strict=True):
            handles += [] if chart is None else draw_chart(axes, chart)
    for of_row, row, lines in zip(panels, block.rows, block.beside, strict=False):
        if lines:
            last = max(column for column, chart in enumerate(row) if chart is not None)
            _name_beside(of_row[last], line_handles(lines))
    return handles


def _panels(place: SubplotSpec, block: PanelGrid) -> AxesGrid:
    """Return the panels of a block, (rows, columns); panels without a chart are removed."""
    rows, folds = block.folding
    each, columns = len(block.heights), len(block.rows[0])
    places = place.subgridspec(rows * each, folds * columns, height_ratios=[*block.heights] * rows)
    grid = places.subplots(squeeze=False).reshape(rows * each, folds, columns)
    panels = grid.swapaxes(0, 1).reshape(-1, columns)
    for unused in panels[len(block.rows) :].flat:
        unused.remove()
    panels = panels[: len(block.rows)]
    present = np.array([[chart is not None for chart in row] for row in block.rows])
    for unused in panels[~present]:
        unused.remove()
    for first in range(0, len(present), rows * each):
        fold = slice(first, first + rows * each)
        for column, there in zip(panels[fold].T, present[fold].T, strict=True):
            if there.any():
                share_time(column[there], block.time, block.xlabel)
                if len(column) < rows * each:  # labels use the empty place below, else they tear rows apart
                    column[there][-1].xaxis.set_in_layout(False)
    return panels


def share_time(column: Sequence[Axes], time: FloatArray, label: str = f"time [{TIME}]") -> None:
    """Share a time axis with this span among panels, top to bottom, and label it below the last."""
    for axes in column[:-1]:
        axes.sharex(column[-1])
        axes.tick_params(labelbottom=False)
    column[-1].set_xlabel(label)
    if time[0] >= LATE:
        whole = math.floor(time[0])
        column[-1].set_xlabel(f"time after {whole} {TIME} [{TIME}]")
        column[-1].xaxis.set_major_formatter(lambda tick, _: f"{tick - whole:g}")
    if time[-1] > time[0]:
        column[-1].set_xlim(time[0], time[-1])
        if time[-1] - time[0] < FINE:
            column[-1].locator_params(axis="x", nbins=FEW_TICKS)


def _name_beside(axes: Axes, handles: Sequence[Artist]) -> None:
    """Add a legend of lines at the right of a panel."""
    labels = [shortened(str(handle.get_label()), LABEL_BESIDE) for handle in handles]
    _take_literally(axes.legend(handles, labels, loc="center left", bbox_to_anchor=(1.0, 0.5)))


def complete(figure: Figure, title: str, handles: Sequence[Artist]) -> Figure:
    """Add the title and, below all panels, one legend with each label once in as many columns as fit."""
    look = current_look()
    if look.title:
        figure.suptitle(_title(title, figure), fontsize=1.1 * look.font_size, parse_math=False)
    by_label = {str(handle.get_label()): handle for handle in handles}
    if by_label:
        labels = ["\n".join(map(shortened, label.split("\n"))) for label in by_label]
        longest = max(len(line) for label in labels for line in label.split("\n"))
        width = look.scale * (_INCHES_PER_HANDLE + _INCHES_PER_CHARACTER * longest)
        rows = math.ceil(len(labels) / max(1, int(figure.get_figwidth() / width)))
        columns = math.ceil(len(labels) / rows)
        legend = figure.legend(list(by_label.values()), labels, loc="outside lower center", ncols=columns)
        _take_literally(legend)
        if look.width is not None and look.height is None:
            more = max(0, rows - ROWS_OF_LEGEND)
            figure.set_figheight(figure.get_figheight() + LINE * look.scale * more)
    make_legible(figure)
    if look.width is not None:
        fit_texts(figure)
    return figure


def _title(title: str, figure: Figure) -> str:
    """Return a title of limited length, in lines as wide as the figure if its width is fixed."""
    look, whole = current_look(), shortened(title, TITLE_LENGTH)
    if look.width is None:
        return whole
    return broken(whole, int(figure.get_figwidth() / (TITLE_CHARACTER * look.scale)))


def _take_literally(legend: Legend) -> None:
    for text in legend.get_texts():
        text.set_parse_math(False)
