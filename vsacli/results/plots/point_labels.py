"""Labels next to points of a panel, none on top of another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from vsacli.base.arrays import FloatArray
from vsacli.results.charts.look import current_look
from vsacli.results.plots.long_texts import POINTS_PER_INCH

SIZE = 8
"""Size of the font at the usual font size, points."""

LETTER, LINE = 0.075, 0.14
"""Width of a character and height of a line at that size, inches."""

GAP = 5.0
"""Distance between a point and its label at the usual font size, points."""


class _Side(NamedTuple):
    """A place for a label: its direction from the point, and the alignment of its text."""

    across: int
    up: int
    align: str
    valign: str

    def box(self, point: FloatArray, width: float) -> FloatArray:
        """Return the corners of a label, [[left, bottom], [right, top]], inches."""
        gap, size = GAP / POINTS_PER_INCH, np.array([width, LINE])
        center = point + np.array([self.across, self.up]) * (gap + size / 2)
        return np.array([center - size / 2, center + size / 2])


_RIGHT, _LEFT = _Side(1, 0, "left", "center"), _Side(-1, 0, "right", "center")
_ABOVE, _BELOW = _Side(0, 1, "center", "bottom"), _Side(0, -1, "center", "top")
_ABOVE_LEFT, _ABOVE_RIGHT = _Side(-1, 1, "right", "bottom"), _Side(1, 1, "left", "bottom")
_BELOW_LEFT, _BELOW_RIGHT = _Side(-1, -1, "right", "top"), _Side(1, -1, "left", "top")

BESIDE = (_RIGHT, _LEFT, _ABOVE, _BELOW, _ABOVE_LEFT, _ABOVE_RIGHT, _BELOW_LEFT, _BELOW_RIGHT)
"""Sides of single points, the preferred ones first."""

BELOW = (_BELOW_RIGHT, _ABOVE_LEFT, _RIGHT, _LEFT)
"""Sides on which labels are clear of a rising line through the points."""


def label_points(
    axes: Axes, places: Sequence[tuple[float, float]], labels: Sequence[str], sides: Sequence[_Side] = BESIDE
) -> None:
    """Write a label next to each point, on a side where it overlaps no other; else leave it out.

    Points at the same place share a label. All points of the panel must be drawn before.

    Args:
        axes: panel with linear axes.
        places: points in coordinates of the data.
        labels: labels of the points, the most important first.
        sides: sides to try, the preferred ones first.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None, "panels belong to figures"
    axes.autoscale_view()  # else the transformation below has not seen the last curves
    size = np.asarray(axes.get_position().size) * figure.get_size_inches() / _scale()
    points = [axes.transLimits.transform(place) * size for place in places]
    marks = [
        np.array([point - GAP / POINTS_PER_INCH / 2, point + GAP / POINTS_PER_INCH / 2]) for point in points
    ]
    taken = list(marks)
    for text, members in _grouped(points, labels):
        own = members[0]
        for side in sides:
            box = side.box(points[own], LETTER * len(text))
            inside = (box[0] >= 0).all() and (box[1] <= size).all()
            others = [each for number, each in enumerate(taken) if number not in members]
            if inside and not any(map(_overlapping, [box] * len(others), others)):
                taken.append(box)
                _write(axes, text, places[own], side)
                break


def _scale() -> float:
    """Return the size of labels and distances relative to the declared ones."""
    return current_look().points(SIZE) / SIZE


def _grouped(points: Sequence[FloatArray], labels: Sequence[str]) -> Iterator[tuple[str, list[int]]]:
    """Yield the common label of points at the same place, and the numbers of these points."""
    left = list(range(len(points)))
    while left:
        members = [
            at for at in left if np.abs(points[at] - points[left[0]]).max() < GAP / POINTS_PER_INCH / 2
        ]
        left = [at for at in left if at not in members]
        yield ", ".join(labels[at] for at in members), members


def _overlapping(one: FloatArray, other: FloatArray) -> bool:
    return bool((one[0] < other[1]).all() and (other[0] < one[1]).all())


def _write(axes: Axes, text: str, place: tuple[float, float], side: _Side) -> None:
    aligned: dict[str, Any] = {"ha": side.align, "va": side.valign}
    gap = GAP * _scale()
    offset = (gap * side.across, gap * side.up)
    axes.annotate(text, place, offset, textcoords="offset points", fontsize=SIZE * _scale(), **aligned)
