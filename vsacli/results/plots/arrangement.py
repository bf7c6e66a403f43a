"""Arrangement of panels in a figure of a given size: fewer side by side where it is narrow.

Where the width alone is fixed, as many panels as fit are side by side, and the figure is as high as they
require. Where the height is fixed as well, the arrangement is chosen that permits the largest font.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from typing import NamedTuple, TypeAlias, TypeVar

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsacli.results.charts.chart import PANEL_WIDTH, PanelGrid, Sheet
from vsacli.results.charts.figures import LEGEND_WIDTH
from vsacli.results.charts.look import CM_PER_INCH, current_look
from vsacli.results.plots.styles import new_figure

NARROWEST = 2.2
"""Smallest width of a panel at the usual font size, inches, including the labels of its axes."""

AROUND, BETWEEN = 1.0, 0.4
"""Height of title, legend and labels of the time axis, and of the labels between stacked blocks, at the usual
font size, inches."""

HIGHEST = 9.5
"""Height of a page, inches; higher figures of a fixed width have as many panels side by side as fit."""

MOST_ROWS = 6
"""Maximum number of rows of two panels; further panels continue at the right."""

MOST_COLUMNS = 8
"""Maximum number of panels side by side that is tried where width and height are fixed."""

WORTHWHILE = 1.15
"""Ratio of font sizes from which another arrangement than the declared one is chosen."""

Size: TypeAlias = tuple[float, float]
"""Width and height of a figure at the usual font size, inches."""


class Arrangement(NamedTuple):
    """Blocks and their places.

    Attributes:
        natural: size of the figure at the usual font size, inches.
        blocks: blocks of panels, folded to fit.
        stacked: whether the blocks are below each other.
        shares: widths of blocks side by side, or heights of stacked blocks, relative.
    """

    natural: Size
    blocks: list[PanelGrid]
    stacked: bool
    shares: list[float]


def arrange_blocks(sheet: Sheet) -> Arrangement:
    """Arrange the blocks of a sheet for the current look: as declared, unless its width is fixed."""
    look = current_look()
    declared = Arrangement(sheet.size, list(sheet.blocks), stacked=False, shares=list(sheet.widths))
    if look.width is None:
        return declared
    if look.height is None:
        panel_columns = _columns_that_fit()
        fits = sum(block.columns for block in sheet.blocks) <= panel_columns
        return (
            declared
            if fits and look.scale * sheet.size[1] <= HIGHEST
            else _stacked_blocks(sheet, panel_columns)
        )
    stacked_options = (_stacked_blocks(sheet, panel_columns) for panel_columns in range(1, MOST_COLUMNS + 1))
    return _largest_font((declared, *stacked_options), lambda option: option.natural)


def columns_of_panels(declared: int, natural: Callable[[int], Size], narrowest: float = NARROWEST) -> int:
    """Return the number of panels side by side for the current look.

    Args:
        declared: number of panels side by side if there is room for them.
        natural: size of the figure for a number of panels side by side.
        narrowest: smallest width of a panel, inches.
    """
    look = current_look()
    if look.width is None:
        return declared
    if look.height is None:
        return min(declared, _columns_that_fit(narrowest))
    columns: int = _largest_font((declared, *range(1, MOST_COLUMNS + 1)), natural)
    return columns


@contextmanager
def panel_grid(count: int, height: float) -> Iterator[tuple[Figure, list[Axes]]]:
    """Yield a figure with this number of panels, row by row, of this height each, inches."""
    declared = min(2 * math.ceil(count / (2 * MOST_ROWS)), count)

    def natural(columns: int) -> Size:
        return PANEL_WIDTH * max(2, columns), height * math.ceil(count / columns) + 1.1

    columns = min(count, columns_of_panels(declared, natural))
    with new_figure(natural(columns)) as figure:
        panels = figure.subplots(math.ceil(count / columns), columns, squeeze=False).flatten()
        for unused in panels[count:]:
            unused.remove()
        yield figure, list(panels[:count])


Option = TypeVar("Option")


def _largest_font(options: Sequence[Option], natural: Callable[[Option], Size]) -> Option:
    """Return the option with the largest font, or the first one if that is not much smaller."""
    fonts = [current_look().fitted(natural(option)).font_size for option in options]
    best = fonts.index(max(fonts))
    return options[best if fonts[best] > WORTHWHILE * fonts[0] else 0]


def _columns_that_fit(narrowest: float = NARROWEST) -> int:
    """Return the number of panels that fit side by side into the fixed width."""
    look = current_look()
    assert look.width is not None, "a width is fixed"
    return max(1, int(look.width / CM_PER_INCH / (narrowest * look.scale)))


def _stacked_blocks(sheet: Sheet, columns: int) -> Arrangement:
    """Arrange a sheet with at most this number of panels side by side: blocks below each other."""
    blocks = [_fold_to_columns(block, columns) for block in sheet.blocks]
    heights = [block.height for block in blocks]
    names_width = LEGEND_WIDTH if any(block.beside for block in blocks) else 0.0
    width = PANEL_WIDTH * max(2, *(block.columns for block in blocks)) + names_width
    height = sum(heights) + AROUND + BETWEEN * (len(blocks) - 1)
    return Arrangement((width, height), blocks, stacked=True, shares=heights)


def _fold_to_columns(block: PanelGrid, columns: int) -> PanelGrid:
    """Return a block with at most this number of panels side by side."""
    block = _divide_rows(block, columns)
    if block.most_rows is None:
        return block
    group_count = len(block.rows) // len(block.heights)
    group_columns = max(1, min(group_count, columns // len(block.rows[0])))
    return block._replace(most_rows=math.ceil(group_count / group_columns))


def _divide_rows(block: PanelGrid, columns: int) -> PanelGrid:
    """Return a block whose rows are divided where they have more panels than that; the first part is short.

    Groups of rows stay together, so that a difference remains below its curves.
    """
    row_length, group_rows = len(block.rows[0]), len(block.heights)
    if row_length <= columns:
        return block
    part_count = math.ceil(row_length / columns)
    padded = [
        [*row[: row_length % columns], *[None] * (-row_length % columns), *row[row_length % columns :]]
        for row in block.rows
    ]
    groups = [padded[first : first + group_rows] for first in range(0, len(padded), group_rows)]
    rows = [
        row[columns * part : columns * (part + 1)]
        for group in groups
        for part in range(part_count)
        for row in group
    ]
    beside = [block.beside[first : first + group_rows] for first in range(0, len(block.beside), group_rows)]
    legends = list(chain.from_iterable(list(names) * part_count for names in beside))
    return block._replace(rows=rows, heights=[*block.heights] * part_count, beside=legends)
