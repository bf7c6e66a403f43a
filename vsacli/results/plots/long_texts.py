"""Titles and labels longer than their panel, broken into lines where the width of a figure is fixed."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FixedLocator, MaxNLocator

from vsacli.results.charts.look import current_look
from vsacli.results.plots.styles import TICK_SIZE, shortened

UNDIVIDED = re.compile(r"\$[^$]*\$|\[[^\]]*\]|\d (?:N m|%|\w+)|motor \d")
"""Parts of a text that stay in one line: formulas, units, values with their units, and motors."""

SEPARATORS = (r"(?<=,) ", " ", r"(?<=\.)(?=[a-z])")
"""Places at which texts are divided, the preferred ones first."""

NO_BREAK = "\N{NO-BREAK SPACE}"

MIN_LINE_LENGTH = 8
"""Smallest length of a line, characters."""

POINTS_PER_INCH = 72.0

LINE_HEIGHT = 0.17
"""Height of a line at the usual font size, inches."""

OVERHANG, SAFE = 1.1, 0.95
"""Width that the label of an axis may have, relative to its panel; and share of its room that a text may
take, since widths depend on the resolution."""

TICK_GAP = 0.3
"""Smallest distance between labels of ticks, relative to their font size."""


def fit_texts(figure: Figure) -> None:
    """Break texts of panels that are too long, and remove ticks whose labels overlap.

    The figure grows by the further lines if its height is free.
    """
    look = current_look()
    for axes in figure.axes:  # else the number of ticks depends on the settings when the figure is saved
        axes.tick_params(labelsize=look.points(TICK_SIZE))
    figure.draw_without_rendering()
    added_lines: dict[int, int] = defaultdict(int)
    for axes in figure.axes:
        _thin_ticks(axes, figure.dpi)
        for text, available, upright in _texts_with_room(axes):
            bbox = text.get_window_extent()
            text_length = bbox.height if upright else bbox.width
            if text_length > SAFE * available:
                original = text.get_text()
                text.set_text(
                    wrapped(
                        original,
                        max(MIN_LINE_LENGTH, int(_longest_line(original) * SAFE * available / text_length)),
                    )
                )
                if not upright:
                    added_lines[round(axes.bbox.x0)] += text.get_text().count("\n") - original.count("\n")
    _keep_inside(figure)
    if look.height is None:
        lines = max(added_lines.values(), default=0)
        figure.set_figheight(figure.get_figheight() + LINE_HEIGHT * look.scale * lines)


def wrapped(text: str, length: int) -> str:
    """Break a text into lines of limited length between words; shorten words that are longer than a line."""
    lines: list[str] = []
    for line in text.split("\n"):
        unbroken = UNDIVIDED.sub(lambda match: match[0].replace(" ", NO_BREAK), line)
        lines += _divided_lines(unbroken, length, SEPARATORS)
    return "\n".join(lines).replace(NO_BREAK, " ")


def _divided_lines(text: str, length: int, separators: tuple[str, ...]) -> list[str]:
    """Return the lines of a text that is divided at the first separators as far as that is enough."""
    if len(text) <= length:
        return [text]
    if not separators:
        return [text if "$" in text else shortened(text, length)]
    separator = " " if separators[0].endswith(" ") else ""
    lines: list[str] = []
    for part in re.split(separators[0], text):
        if lines and len(lines[-1]) + len(separator) + len(part) <= length:
            lines[-1] += separator + part
        else:
            lines += _divided_lines(part, length, separators[1:])
    return lines


def _keep_inside(figure: Figure) -> None:
    """Leave space at the right for labels of ticks there, which some columns have outside of the layout."""
    ends = [label.get_window_extent().x1 for axes in figure.axes for label in _shown_labels(axes)]
    overhang = max(ends, default=0.0) / figure.bbox.width - 1
    engine = figure.get_layout_engine()
    if overhang > 0 and isinstance(engine, ConstrainedLayoutEngine):
        engine.set(rect=(0.0, 0.0, 1.0 - overhang, 1.0))


def _thin_ticks(axes: Axes, dpi: float) -> None:
    """Reduce the number of ticks of time, speed or torque until their labels are apart."""
    locator = axes.xaxis.get_major_locator()
    if not isinstance(locator, MaxNLocator | FixedLocator):
        return
    gap = TICK_GAP * current_look().points(TICK_SIZE) * dpi / POINTS_PER_INCH
    for bins in range(len(axes.get_xticks()) - 1, 1, -1):
        extents = [label.get_window_extent() for label in _shown_labels(axes)]
        if all(right.x0 - left.x1 >= gap for left, right in pairwise(extents)):
            return
        locator.set_params(nbins=bins)


def _shown_labels(axes: Axes) -> list[Text]:
    """Return the labels of the ticks of the horizontal axis that are drawn."""
    low, high = sorted(axes.get_xlim())
    tolerance = 1e-6 * (high - low)
    axes.get_xticklabels()  # places the ticks
    visible_labels = [
        tick.label1
        for tick in axes.xaxis.get_major_ticks()
        if -tolerance <= tick.get_loc() - low <= high - low + tolerance
    ]
    return [label for label in visible_labels if label.get_visible() and label.get_text()]


def _longest_line(text: str) -> int:
    return max(map(len, text.split("\n")))


def _texts_with_room(axes: Axes) -> Iterator[tuple[Text, float, bool]]:
    """Yield titles, labels and notes of a panel, each with its room in pixels and whether it is upright."""
    box = axes.get_window_extent()
    for text in axes.get_children():
        if not isinstance(text, Text) or isinstance(text, Annotation):
            continue
        if text not in axes.texts or text.get_transform() == axes.transAxes:
            yield text, box.width, False
    yield axes.xaxis.label, OVERHANG * box.width, False
    yield axes.yaxis.label, OVERHANG * box.height, True
