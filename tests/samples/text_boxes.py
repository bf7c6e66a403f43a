"""The texts that a figure shows, and where its renderer places them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

OVERLAP = 1.0
"""Overlap, pixels, that antialiasing alone may cause."""


def shown_texts(figure: Figure) -> list[tuple[Text, Bbox]]:
    """Texts of a figure with their boxes in pixels; ticks outside of their axis are not drawn."""
    FigureCanvasAgg(figure).draw()
    ticks = [
        (tick, axis)
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks())
    ]
    hidden = {
        label
        for tick, axis in ticks
        for label in (tick.label1, tick.label2)
        if not min(axis.get_view_interval()) <= tick.get_loc() <= max(axis.get_view_interval())
    }
    texts = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]
    return [(text, text.get_window_extent()) for text in texts if text not in hidden]


def collisions(figure: Figure, boxes: Sequence[tuple[Text, Bbox]]) -> list[tuple[str, str]]:
    """Pairs of shown texts that overlap, and texts with the edge of the figure that cuts them off."""
    pairs = [
        (one.get_text(), other.get_text())
        for (one, box), (other, beside) in combinations(boxes, 2)
        if min(box.x1, beside.x1) - max(box.x0, beside.x0) > OVERLAP
        and min(box.y1, beside.y1) - max(box.y0, beside.y0) > OVERLAP
    ]
    inside = figure.bbox.padded(OVERLAP)
    cut = [text for text, box in boxes if not (inside.contains(*box.min) and inside.contains(*box.max))]
    return pairs + [(text.get_text(), "edge") for text in cut]
