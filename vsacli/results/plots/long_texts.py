"""Titles and labels longer than their panel, broken into lines where the width of a figure is fixed."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text

from vsacli.results.charts.look import current_look
from vsacli.results.plots.styles import shortened

WORD = re.compile(r"(?:\$[^$]*\$|\[[^\]]*\]|\S)+")
"""A word; formulas and units are not divided."""

FEWEST = 8
"""Smallest length of a line, characters."""

LINE = 0.17
"""Height of a line at the usual font size, inches."""

OVERHANG = 1.1
"""Width that the label of an axis may have, relative to its panel."""


def break_long_texts(figure: Figure) -> None:
    """Break texts of panels that are too long; the figure grows by further lines if its height is free."""
    figure.draw_without_rendering()
    look = current_look()
    added: dict[int, int] = defaultdict(int)
    for axes in figure.axes:
        for text, room, upright in _texts(axes):
            extent = text.get_window_extent()
            taken = extent.height if upright else extent.width
            if taken > room:
                before = text.get_text()
                text.set_text(broken(before, max(FEWEST, int(_longest(before) * room / taken))))
                if not upright:
                    added[round(axes.bbox.x0)] += text.get_text().count("\n") - before.count("\n")
    if look.height is None:
        lines = max(added.values(), default=0)
        figure.set_figheight(figure.get_figheight() + LINE * look.scale * lines)


def broken(text: str, length: int) -> str:
    """Break a text into lines of limited length between words; shorten words that are longer than a line."""
    lines: list[str] = []
    for line in text.split("\n"):
        current = ""
        for word in WORD.findall(line):
            fitting = word if "$" in word else shortened(word, length)
            if current and len(current) + 1 + len(fitting) > length:
                lines.append(current)
                current = fitting
            else:
                current = f"{current} {fitting}".strip()
        lines.append(current)
    return "\n".join(lines)


def _longest(text: str) -> int:
    return max(map(len, text.split("\n")))


def _texts(axes: Axes) -> Iterator[tuple[Text, float, bool]]:
    """Yield titles, labels and notes of a panel, each with its room in pixels and whether it is upright."""
    box = axes.get_window_extent()
    for text in axes.get_children():
        in_panel = isinstance(text, Text) and not isinstance(text, Annotation)
        if in_panel and (text not in axes.texts or text.get_transform() == axes.transAxes):
            yield text, box.width, False
    yield axes.xaxis.label, OVERHANG * box.width, False
    yield axes.yaxis.label, OVERHANG * box.height, True
