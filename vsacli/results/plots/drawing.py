"""Curves that break at gaps, their limits and deviations, bands where steps fail."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.results.curves import Curve
from vsacli.results.envelopes import marked_spans
from vsacli.results.plots.styles import LineStyle, line_style

MARKERS_PER_CURVE = 8
MARKER_STAGGER = 0.37
"""Shift of the markers from curve to curve, in marker distances: those of coinciding curves stay apart."""

# Opaque and edged: bands do not darken where they meet, and a single step stays visible.
_INFEASIBLE_BAND = {"facecolor": "0.8", "edgecolor": "0.8", "linewidth": 1.5, "zorder": 0.5}
_SPREAD: dict[str, Any] = {"alpha": 0.3, "linewidth": 0}
_SINGULAR_BAND = {"facecolor": "none", "edgecolor": "0.45", "linewidth": 0.8, "hatch": "////", "zorder": 0.6}


ZERO: dict[str, Any] = {"color": "0.6", "linewidth": 0.8}
"""Line of what differences and margins are seen against."""

_LIMIT: dict[str, Any] = {"linewidth": 0.8, "linestyle": (0, (1, 2))}

LIMIT_SIGHT = 0.5
"""Share of the height of a panel beyond it within which limits are still drawn: farther ones would leave
curves less than half of it."""

LIMIT_ROOM = 0.05
"""Free space behind a limit, as a share of that sight."""

_ENVELOPE: dict[str, Any] = {"alpha": 0.3, "linewidth": 0.5}


def draw_curve(axes: Axes, curve: Curve, index: int, style: LineStyle) -> list[Artist]:
    """Draw a curve that breaks at NaN; a point alone between two gaps becomes a dot.

    Of one whose samples would make a blot of a line, their mean and what they span.

    Args:
        axes: where to draw.
        curve: of a joint or result.
        index: number of the curve in its panel, which places its markers.
        style: colour, dashes and marker.

    Returns:
        What a legend shows besides the line.
    """
    time, values = (curve.time, curve.values) if curve.envelope is None else curve.envelope[:2]
    markers = _marker_points(time, index * MARKER_STAGGER % 1)
    axes.plot(time, values, **style.words, markevery=markers)
    gap = np.pad(np.isnan(values), 1, constant_values=True)
    alone = ~gap[1:-1] & gap[:-2] & gap[2:]
    if alone.any():
        axes.plot(time[alone], values[alone], color=style.color, linestyle="none", marker=".", markersize=4)
    if curve.envelope is None:
        return []
    axes.fill_between(time, curve.envelope.low, curve.envelope.high, color=style.color, **_ENVELOPE)
    return [Patch(color="0.5", **_ENVELOPE, label="smallest to largest")]


def _marker_points(time: FloatArray, shift: float) -> list[int]:
    """Points next to `MARKERS_PER_CURVE` equidistant times."""
    wanted = time[0] + (np.arange(MARKERS_PER_CURVE) + shift) / MARKERS_PER_CURVE * (time[-1] - time[0])
    return [int(point) for point in np.unique(np.searchsorted(time, wanted))]


def draw_uncertainty(
    axes: Axes, time: FloatArray, values: FloatArray, deviations: FloatArray, style: LineStyle
) -> list[Artist]:
    """A band of two standard deviations to both sides of a curve that is drawn already.

    The axes keep their range, as at the ends of a record deviations may be hundreds of times those inside.

    Returns:
        What a legend shows for it; nothing if there is no deviation.
    """
    if np.all(np.isnan(deviations)):
        return []
    shown = axes.get_ylim()
    axes.fill_between(time, values - 2 * deviations, values + 2 * deviations, color=style.color, **_SPREAD)
    axes.set_ylim(shown)
    return [Patch(facecolor="0.5", **_SPREAD, label="two standard deviations")]


def draw_limits(axes: Axes, ranges: Mapping[int, FloatArray]) -> list[Artist]:
    """Draw what curves are bounded by, as far as it is in sight or nearly so.

    Args:
        axes: where to draw, with all curves.
        ranges: lower and upper bound by number of the curve, which gives the colour; not finite where there
            is none.

    Returns:
        What a legend shows for them.
    """
    low, high = axes.get_ylim()
    reach = LIMIT_SIGHT * (high - low)
    seen = {
        (index, float(end))
        for index, ends in ranges.items()
        for end in ends
        if low - reach <= end <= high + reach
    }
    for index, end in sorted(seen):
        axes.axhline(end, color=line_style(index).color, **_LIMIT)
        low, high = min(low, end - LIMIT_ROOM * reach), max(high, end + LIMIT_ROOM * reach)
    axes.set_ylim(low, high)
    return [Line2D([], [], color="0.4", **_LIMIT, label="limit")] if seen else []


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
