"""Labels next to points of a panel, none on top of another, and on as few points as possible."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from vsacli.base.arrays import FloatArray
from vsacli.results.charts.look import current_look
from vsacli.results.plots.long_texts import POINTS_PER_INCH

BELOW_MARKS = 1.9
"""Order of drawing, in which curves have 2."""

_LEADER: dict[str, Any] = {"arrowstyle": "-", "color": "0.4", "linewidth": 0.6, "shrinkA": 0, "shrinkB": 2}

SIZE = 8
"""Size of the font at the usual font size, points."""

LETTER_WIDTH, LINE_HEIGHT = 0.075, 0.14
"""Width of a character and height of a line at that size, inches."""

GAP = 5.0
"""Distance between a point and its label at the usual font size, points."""

DISTANCES = (1.0, 3.0, 5.0)
"""Distances to try, in gaps; beyond the first a line leads to the point."""

FARTHER = 6.0
"""Further distance, in gaps, that is as bad as a covered point."""


class _Side(NamedTuple):
    """A place for a label: its direction from the point, and the alignment of its text."""

    across: int
    up: int
    align: str
    valign: str

    def box(self, point: FloatArray, width: float, distance: float) -> FloatArray:
        """Return the corners of a label some gaps from a point, [[left, bottom], [right, top]], inches."""
        gap, box_size = distance * GAP / POINTS_PER_INCH, np.array([width, LINE_HEIGHT])
        center = point + np.array([self.across, self.up]) * (gap + box_size / 2)
        return np.array([center - box_size / 2, center + box_size / 2])


_RIGHT, _LEFT = _Side(1, 0, "left", "center"), _Side(-1, 0, "right", "center")
_ABOVE, _BELOW = _Side(0, 1, "center", "bottom"), _Side(0, -1, "center", "top")
_ABOVE_LEFT, _ABOVE_RIGHT = _Side(-1, 1, "right", "bottom"), _Side(1, 1, "left", "bottom")
_BELOW_LEFT, _BELOW_RIGHT = _Side(-1, -1, "right", "top"), _Side(1, -1, "left", "top")

SIDES_OF_POINT = (_RIGHT, _LEFT, _ABOVE, _BELOW, _ABOVE_LEFT, _ABOVE_RIGHT, _BELOW_LEFT, _BELOW_RIGHT)
"""Sides of single points, the preferred ones first."""

SIDES_BELOW_LINE = (_BELOW_RIGHT, _ABOVE_LEFT, _RIGHT, _LEFT)
"""Sides on which labels are clear of a rising line through the points."""


def label_points(
    axes: Axes,
    positions: Sequence[tuple[float, float]],
    labels: Sequence[str],
    sides: Sequence[_Side] = SIDES_OF_POINT,
) -> None:
    """Write a label next to each point, on a side where it overlaps no other; else leave it out.

    Of these sides it is on the one where it covers the fewest points of the panel, if need be farther away.
    Points at the same place share a label. The figure must be complete, since the places depend on its
    layout.

    Args:
        axes: panel with linear axes.
        positions: points in coordinates of the data.
        labels: labels of the points, the most important first.
        sides: sides to try, the preferred ones first.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None, "panels belong to figures"
    figure.draw_without_rendering()
    size = np.asarray(axes.get_position().size) * figure.get_size_inches() / _scale()
    points = [axes.transLimits.transform(position) * size for position in positions]
    label_boxes = list(map(_mark_box, points))
    mark_arrays = [line.get_xydata() for line in axes.get_lines() if line.get_marker() != "None"]
    mark_boxes = [
        _mark_box(axes.transLimits.transform(position) * size)
        for line in mark_arrays
        for position in np.asarray(line)
    ]
    for text, members in _group_coincident(points, labels):
        point = members[0]
        other_boxes = [box_of_other for index, box_of_other in enumerate(label_boxes) if index not in members]
        candidates = []
        for distance, side in product(DISTANCES, sides):
            box = side.box(points[point], LETTER_WIDTH * len(text), distance)
            inside = (box[0] >= 0).all() and (box[1] <= size).all()
            if inside and not _count_overlapping(box, other_boxes):
                candidates.append(
                    (_count_overlapping(box, mark_boxes) + distance / FARTHER, distance, side, box)
                )
        if candidates:
            _, distance, side, box = min(candidates, key=lambda place: place[0])
            label_boxes.append(box)
            _write_label(axes, text, positions[point], side, distance)


def _mark_box(point: FloatArray) -> FloatArray:
    """Return the corners of a mark, inches."""
    return np.array([point - GAP / POINTS_PER_INCH / 2, point + GAP / POINTS_PER_INCH / 2])


def _scale() -> float:
    """Return the size of labels and distances relative to the declared ones."""
    return current_look().points(SIZE) / SIZE


def _group_coincident(points: Sequence[FloatArray], labels: Sequence[str]) -> Iterator[tuple[str, list[int]]]:
    """Yield the common label of points at the same place, and the numbers of these points."""
    ungrouped = list(range(len(points)))
    while ungrouped:
        members = [
            index
            for index in ungrouped
            if np.abs(points[index] - points[ungrouped[0]]).max() < GAP / POINTS_PER_INCH / 2
        ]
        ungrouped = [index for index in ungrouped if index not in members]
        yield ", ".join(labels[index] for index in members), members


def _count_overlapping(box: FloatArray, boxes: Sequence[FloatArray]) -> int:
    """Return the number of boxes that overlap one."""
    low, high = np.swapaxes(np.reshape(boxes, (-1, 2, 2)), 0, 1)
    return int(np.count_nonzero((box[0] < high).all(axis=1) & (low < box[1]).all(axis=1)))


def _write_label(axes: Axes, text: str, position: tuple[float, float], side: _Side, distance: float) -> None:
    alignment: dict[str, Any] = {"ha": side.align, "va": side.valign, "zorder": BELOW_MARKS}
    gap = distance * GAP * _scale()
    offset = (gap * side.across, gap * side.up)
    annotation = axes.annotate(
        text,
        position,
        offset,
        textcoords="offset points",
        fontsize=SIZE * _scale(),
        arrowprops=_LEADER if distance > DISTANCES[0] else None,
        **alignment,
    )
    annotation.set_path_effects([withStroke(linewidth=2 * _scale(), foreground="white")])
