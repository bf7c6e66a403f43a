"""Panels whose scale is not set by the peaks of nearly singular steps; what is cut off is marked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.results.near_singular import calm_range

_MARK: dict[str, Any] = {"markersize": 6, "linestyle": ""}
_BACKGROUND: dict[str, Any] = {"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 0.5}


class Peaked(NamedTuple):
    """A curve of a panel: times and values, (points,), its colour, and which points set the scale."""

    time: FloatArray
    values: FloatArray
    color: str
    calm: BoolArray


class _Peak(NamedTuple):
    """Where a curve leaves the panel, the farthest of a stretch."""

    time: float
    value: float
    color: str


def cut_peaks(axes: Axes, curves: Sequence[Peaked]) -> list[Artist]:
    """Let the calm points of the curves set the scale of a panel, if others are far beyond; mark these.

    Returns:
        What a legend shows for the marks.
    """
    found = calm_range([curve.values for curve in curves], [curve.calm for curve in curves])
    if found is None:
        return []
    bottom, top = found.bottom, found.top
    axes.set_ylim(bottom, top)
    middle = (curves[0].time[0] + curves[0].time[-1]) / 2
    _mark(axes, [peak for curve in curves for peak in _peaks(curve, -1, bottom)], -1, middle)
    _mark(axes, [peak for curve in curves for peak in _peaks(curve, 1, top)], 1, middle)
    return [Line2D([], [], marker="^", color="0.4", **_MARK, label="cut off, near-singular")]


def _peaks(curve: Peaked, sign: int, end: float) -> list[_Peak]:
    """The farthest point of each stretch beyond one end of the panel, which lies at this side."""
    heights = np.where(np.isnan(curve.values), -np.inf, sign * curve.values)
    changes = np.flatnonzero(np.diff(heights > sign * end, prepend=False, append=False))
    stretches = changes.reshape(-1, 2).tolist()
    points = [start + int(np.argmax(heights[start:stop])) for start, stop in stretches]
    return [_Peak(float(curve.time[at]), float(curve.values[at]), curve.color) for at in points]


def _mark(axes: Axes, peaks: Sequence[_Peak], sign: int, middle: float) -> None:
    """A triangle for each peak at the edge that it leaves by, if any does, and the height of the farthest."""
    if not peaks:
        return
    place, edge = axes.get_xaxis_transform(), 0.97 if sign > 0 else 0.03
    marker = "^" if sign > 0 else "v"
    for peak in peaks:
        axes.plot([peak.time], [edge], transform=place, color=peak.color, marker=marker, **_MARK)
    farthest = max(peaks, key=lambda peak: sign * peak.value)
    at_right = farthest.time > middle
    axes.annotate(
        _height(farthest.value),
        (farthest.time, edge),
        (-6 if at_right else 6, 0),
        xycoords=place,
        textcoords="offset points",
        ha="right" if at_right else "left",
        va="top" if sign > 0 else "bottom",
        fontsize=8,
        color=farthest.color,
        bbox=_BACKGROUND,
    )


def _height(value: float) -> str:
    """Three digits, or all before the point of a number that still reads without an exponent."""
    return f"{value:.0f}" if 1000 <= abs(value) < 1e6 else f"{value:.3g}"
