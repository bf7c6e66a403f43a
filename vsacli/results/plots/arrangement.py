"""Arrangement of panels in a figure of a given size: blocks side by side, or stacked where it is narrow."""

from __future__ import annotations

import math
from typing import NamedTuple

from vsacli.results.charts.chart import Block, Sheet
from vsacli.results.charts.look import current_look

NARROWEST = 2.2
"""Smallest width of a panel at the usual font size, inches, including the labels of its axes."""

AROUND = 1.0
"""Height of title, legend and labels of the time axis at the usual font size, inches."""


class Arrangement(NamedTuple):
    """Blocks and their places.

    Attributes:
        size: width and height of the figure, inches.
        blocks: blocks of panels, folded to fit.
        stacked: whether the blocks are below each other.
        shares: widths of blocks side by side, or heights of stacked blocks, relative.
    """

    size: tuple[float, float]
    blocks: list[Block]
    stacked: bool
    shares: list[float]


def arranged(sheet: Sheet) -> Arrangement:
    """Arrange the blocks of a sheet for the current look: as declared, unless its width alone is fixed."""
    look = current_look()
    width, height = look.size(sheet.size)
    if look.width is None or look.height is not None:
        return Arrangement((width, height), list(sheet.blocks), stacked=False, shares=list(sheet.widths))
    columns = max(1, int(width / (NARROWEST * look.scale)))
    stacked = sum(map(_columns, sheet.blocks)) > columns and len(sheet.blocks) > 1
    blocks = [_refolded(block, columns) for block in sheet.blocks] if stacked else list(sheet.blocks)
    heights = [
        (sheet.size[1] - AROUND) * new.folding[0] / old.folding[0]
        for new, old in zip(blocks, sheet.blocks, strict=True)
    ]
    height = look.scale * ((sum if stacked else max)(heights) + AROUND)
    return Arrangement((width, height), blocks, stacked, heights if stacked else list(sheet.widths))


def _columns(block: Block) -> int:
    """Return the number of panels of a block side by side."""
    return block.folding[1] * len(block.rows[0])


def _refolded(block: Block, columns: int) -> Block:
    """Return a block with at most `columns` panels side by side, if its rows can be folded otherwise."""
    if block.most_rows is None:
        return block
    groups = len(block.rows) // len(block.heights)
    folds = max(1, min(block.folding[1], columns // len(block.rows[0])))
    return block._replace(most_rows=math.ceil(groups / folds))
