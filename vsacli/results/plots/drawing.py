"""What every panel is drawn with: curves that break at gaps, bands where steps fail."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.results.plots.decimation import marked_spans
from vsacli.results.plots.style import LineStyle

MARKERS_PER_CURVE = 8
MARKER_STAGGER = 0.37
"""Shift of the markers from curve to curve, in marker distances: those of coinciding curves stay apart."""

# Opaque and edged: bands do not darken where they meet, and a single step stays visible.
_INFEASIBLE_BAND = {"facecolor": "0.8", "edgecolor": "0.8", "linewidth": 1.5, "zorder": 0.5}
_SINGULAR_BAND = {"facecolor": "none", "edgecolor": "0.45", "linewidth": 0.8, "hatch": "////", "zorder": 0.6}


def draw_curve(axes: Axes, time: FloatArray, values: FloatArray, index: int, style: LineStyle) -> None:
    """Draw a curve that breaks at NaN; a point alone between two gaps becomes a dot.

    Args:
        axes: where to draw.
        time: (points,), s.
        values: (points,).
        index: number of the curve in its panel, which places its markers.
        style: colour, dashes and marker.
    """
    markers = _marker_points(time, index * MARKER_STAGGER % 1)
    axes.plot(time, values, **style.words, markevery=markers)
    gap = np.pad(np.isnan(values), 1, constant_values=True)
    alone = ~gap[1:-1] & gap[:-2] & gap[2:]
    if alone.any():
        axes.plot(time[alone], values[alone], color=style.color, linestyle="none", marker=".", markersize=4)


def _marker_points(time: FloatArray, shift: float) -> list[int]:
    """Points next to `MARKERS_PER_CURVE` equidistant times."""
    wanted = time[0] + (np.arange(MARKERS_PER_CURVE) + shift) / MARKERS_PER_CURVE * (time[-1] - time[0])
    return [int(point) for point in np.unique(np.searchsorted(time, wanted))]


def line_handle(style: LineStyle, label: str) -> Artist:
    """What a legend shows for a curve."""
    return Line2D([], [], **style.words, label=label)


def draw_bands(axes: Axes, time: FloatArray, infeasible: BoolArray, singular: BoolArray) -> list[Artist]:
    """Grey bands where steps are infeasible, hatched ones where they are singular, over the full height.

    Args:
        axes: where to draw.
        time: (samples,), s.
        infeasible: (samples,).
        singular: (samples,).

    Returns:
        What a legend shows for the bands drawn.
    """
    kinds = ((infeasible, _INFEASIBLE_BAND, "infeasible"), (singular, _SINGULAR_BAND, "singular"))
    return [
        _draw_band(axes, marked_spans(time, steps), look, label)
        for steps, look, label in kinds
        if steps.any()
    ]


def _draw_band(axes: Axes, spans: FloatArray, look: dict[str, Any], label: str) -> Artist:
    extents = [(start, end - start) for start, end in spans.tolist()]
    axes.broken_barh(extents, (0, 1), transform=axes.get_xaxis_transform(), label=label, **look)
    return Patch(**look, label=label)
