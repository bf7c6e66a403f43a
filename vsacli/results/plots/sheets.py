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
from vsacli.results.plots.arrangement import arrange_blocks
from vsacli.results.plots.long_texts import LINE_HEIGHT, fit_texts, wrapped
from vsacli.results.plots.panels import draw_chart
from vsacli.results.plots.styles import line_handle, line_style, make_legible, new_figure, shortened

LATE_START = 1e5
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


def draw_sheet(sheet: Sheet) -> Figure:
    """Draw a sheet as a figure."""
    arrangement = arrange_blocks(sheet)
    with new_figure(arrangement.natural) as figure:
        if arrangement.stacked:
            gridspec = figure.add_gridspec(len(arrangement.blocks), 1, height_ratios=arrangement.shares)
        else:
            gridspec = figure.add_gridspec(1, len(arrangement.blocks), width_ratios=arrangement.shares)
        handles = line_handles(sheet.legend)
        for index, block in enumerate(arrangement.blocks):
            handles += _draw_block(gridspec[index], block)
        return complete(figure, sheet.title, handles)


def line_handles(lines: charts.Legend) -> list[Artist]:
    """Return the legend entries of lines."""
    return [line_handle(line_style(look), label) for label, look in lines.items()]


def _draw_block(subplot_spec: SubplotSpec, block: PanelGrid) -> list[Artist]:
    """Draw the charts of a block; return the legend entries besides those of the lines."""
    handles: list[Artist] = []
    panels = _panels(subplot_spec, block)
    for axes_row, row in zip(panels, block.rows, strict=True):
        for axes, chart in zip(axes_row, row, strict=True):
            handles += [] if chart is None else draw_chart(axes, chart)
    for axes_row, row, lines in zip(panels, block.rows, block.beside, strict=False):
        if lines:
            last = max(column for column, chart in enumerate(row) if chart is not None)
            _name_beside(axes_row[last], line_handles(lines))
    return handles


def _panels(subplot_spec: SubplotSpec, block: PanelGrid) -> AxesGrid:
    """Return the panels of a block, (rows, columns); panels without a chart are removed."""
    rows, folds = block.folding
    group_rows, columns = len(block.heights), len(block.rows[0])
    gridspec = subplot_spec.subgridspec(
        rows * group_rows, folds * columns, height_ratios=[*block.heights] * rows
    )
    grid = gridspec.subplots(squeeze=False).reshape(rows * group_rows, folds, columns)
    panels = grid.swapaxes(0, 1).reshape(-1, columns)
    for unused in panels[len(block.rows) :].flat:
        unused.remove()
    panels = panels[: len(block.rows)]
    present = np.array([[chart is not None for chart in row] for row in block.rows])
    for unused in panels[~present]:
        unused.remove()
    for start in range(0, len(present), rows * group_rows):
        fold_rows = slice(start, start + rows * group_rows)
        for column, has_chart in zip(panels[fold_rows].T, present[fold_rows].T, strict=True):
            if has_chart.any():
                share_time(column[has_chart], block.time, block.xlabel)
                if (
                    len(column) < rows * group_rows
                ):  # labels use the empty place below, else they tear rows apart
                    column[has_chart][-1].xaxis.set_in_layout(False)
    return panels


def share_time(column: Sequence[Axes], time: FloatArray, label: str = f"time [{TIME}]") -> None:
    """Share a time axis with this span among panels, top to bottom, and label it below the last."""
    for axes in column[:-1]:
        axes.sharex(column[-1])
        axes.tick_params(labelbottom=False)
    column[-1].set_xlabel(label)
    if time[0] >= LATE_START:
        whole_seconds = math.floor(time[0])
        column[-1].set_xlabel(f"time after {whole_seconds} {TIME} [{TIME}]")
        column[-1].xaxis.set_major_formatter(lambda tick, _: f"{tick - whole_seconds:g}")
    if time[-1] > time[0]:
        column[-1].set_xlim(time[0], time[-1])
        if time[-1] - time[0] < FINE:
            column[-1].locator_params(axis="x", nbins=FEW_TICKS)


def _name_beside(axes: Axes, handles: Sequence[Artist]) -> None:
    """Add a legend of lines at the right of a panel."""
    labels = [shortened(str(handle.get_label()), LABEL_BESIDE) for handle in handles]
    _disable_math(axes.legend(handles, labels, loc="center left", bbox_to_anchor=(1.0, 0.5)))


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
        legend_rows = math.ceil(len(labels) / max(1, int(figure.get_figwidth() / width)))
        columns = math.ceil(len(labels) / legend_rows)
        legend = figure.legend(list(by_label.values()), labels, loc="outside lower center", ncols=columns)
        _disable_math(legend)
        if look.width is not None and look.height is None:
            extra_rows = max(0, legend_rows - ROWS_OF_LEGEND)
            figure.set_figheight(figure.get_figheight() + LINE_HEIGHT * look.scale * extra_rows)
    make_legible(figure)
    if look.width is not None:
        fit_texts(figure)
    return figure


def _title(title: str, figure: Figure) -> str:
    """Return a title of limited length, in lines as wide as the figure if its width is fixed."""
    look, one_line = current_look(), shortened(title, TITLE_LENGTH)
    if look.width is None:
        return one_line
    return wrapped(one_line, int(figure.get_figwidth() / (TITLE_CHARACTER * look.scale)))


def _disable_math(legend: Legend) -> None:
    for text in legend.get_texts():
        text.set_parse_math(False)
