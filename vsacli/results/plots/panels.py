"""Charts as panels: curves with gaps, bands, limits, marks of cut-off peaks, and shaded failures."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.results.charts.chart import ATTAINABLE, UNCERTAIN, Chart, Failures, Limit, Line
from vsacli.results.charts.look import current_look
from vsacli.results.charts.reduction import Curve, marked_spans
from vsacli.results.plots.styles import LineStyle, line_style, scaled, shortened

MARKERS_PER_CURVE = 8
MARKER_STAGGER = 0.37
"""Shift of the markers from curve to curve, in marker distances, so that markers of equal curves stay
apart."""

LIMIT_SIGHT = 0.5
"""Distance beyond a panel within which limits are still drawn, relative to its height; with more distant
limits the curves would occupy less than half of it."""

LIMIT_ROOM = 0.05
"""Free space beyond a limit, relative to that distance."""

ZERO: dict[str, Any] = {"color": "0.6", "linewidth": 0.8}
"""Style of the zero line of differences and margins."""

_LIMIT: dict[str, Any] = {"linewidth": 0.8, "linestyle": (0, (1, 2))}
_ENVELOPE: dict[str, Any] = {"alpha": 0.3, "linewidth": 0.5}
_SPREAD: dict[str, Any] = {"alpha": 0.3, "linewidth": 0}
_AREA: dict[str, Any] = {"facecolor": "#8fc1ec", "alpha": 0.4, "linewidth": 0, "zorder": 0.8}
_EDGE: dict[str, Any] = {"color": "#6f9fc8", "linewidth": 0.9, "zorder": 1}

# Opaque with an edge, so that adjacent bands do not darken and a single sample stays visible.
_INFEASIBLE = {"facecolor": "0.8", "edgecolor": "0.8", "linewidth": 1.5, "zorder": 0.5}
_SINGULAR = {"facecolor": "none", "edgecolor": "0.45", "linewidth": 0.8, "hatch": "////", "zorder": 0.6}

MARK_DEPTH = 0.03
"""Distance of the mark of a peak from the edge of the panel, relative to the panel."""

STRIP = 0.03
"""Height of the strip that marks failures of one of several joints, relative to the panel."""

SMALL = 8.33
"""Font size of notes inside a panel, points at the usual font size."""

NOTE_SIZE = (0.7, 0.2)
"""Width and height of a note in a corner, relative to the panel."""

NOTE_LENGTH = 24
"""Longest line of a note inside a panel, characters."""

_MARK: dict[str, Any] = {"markersize": 6, "linestyle": ""}
_BACKGROUND: dict[str, Any] = {"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 0.5}


def draw_chart(axes: Axes, chart: Chart) -> list[Artist]:
    """Draw a chart into an empty panel; return the legend entries besides those of its lines."""
    if chart.zero:
        axes.axhline(0.0, **scaled(ZERO))
    corridors = _draw_corridors(axes, chart) if chart.band == ATTAINABLE else None
    handles: list[Artist] = []
    for line in chart.lines:
        handles += draw_curve(axes, line.curve, line_style(line.style_index), line.style_index)
    handles += _draw_spreads(axes, chart.lines) if corridors is None else corridors
    if chart.shown is not None:
        axes.set_ylim(chart.shown)
    if chart.from_zero:
        axes.set_ylim(bottom=0.0)
    handles += _draw_limits(axes, chart.limits)
    floor = axes.get_ylim()[0]
    handles += _mark_failures(axes, chart)
    if chart.cut_off:
        handles += _mark_peaks(axes, chart.lines, floor)
    if chart.note:
        _write_note(
            axes, chart.note, empty=not any(np.isfinite(line.curve.values).any() for line in chart.lines)
        )
    if chart.title:
        add_title(axes, chart.title)
    if chart.axis:
        axes.set_ylabel(chart.axis)
    return handles


def _write_note(axes: Axes, note: str, *, empty: bool) -> None:
    """Write a note into the middle of a panel, and remove the ticks of values if it is empty."""
    _write_inside(axes, (0.5, 0.5), textwrap.fill(note, NOTE_LENGTH), ha="center", va="center")
    if empty:
        axes.set_yticks([])


def _write_inside(axes: Axes, position: tuple[float, float], text: str, *, ha: str, va: str) -> None:
    """Write small gray text at a place relative to the panel."""
    size = current_look().points(SMALL)
    axes.text(*position, text, ha=ha, va=va, fontsize=size, color="0.35", transform=axes.transAxes)


def add_title(axes: Axes, title: str) -> None:
    """Set the title of a panel, left-aligned and without math parsing."""
    axes.set_title(shortened(title), loc="left", parse_math=False)


def draw_curve(axes: Axes, curve: Curve, style: LineStyle, index: int = 0) -> list[Artist]:
    """Draw a curve with gaps at NaN; a single point between two gaps becomes a dot.

    A curve with an envelope is drawn by its mean and range.

    Args:
        axes: panel to draw into.
        curve: curve of a joint or result.
        style: color, dashes and marker.
        index: number of the curve in the panel, which shifts its markers.

    Returns:
        Legend entries besides the line.
    """
    time, values = (curve.time, curve.values) if curve.envelope is None else curve.envelope[:2]
    markers = _marker_points(time, index * MARKER_STAGGER % 1)
    axes.plot(time, values, **style.line_kwargs, markevery=markers)
    gap = np.pad(np.isnan(values), 1, constant_values=True)
    isolated = ~gap[1:-1] & gap[:-2] & gap[2:]
    if isolated.any():
        axes.plot(
            time[isolated], values[isolated], color=style.color, linestyle="none", marker=".", markersize=4
        )
    if curve.envelope is None:
        return []
    axes.fill_between(time, curve.envelope.low, curve.envelope.high, color=style.color, **_ENVELOPE)
    return [Patch(color="0.5", **_ENVELOPE, label="smallest to largest")]


def _marker_points(time: FloatArray, shift: float) -> list[int]:
    """Return the points nearest to `MARKERS_PER_CURVE` equidistant times."""
    marker_times = time[0] + (np.arange(MARKERS_PER_CURVE) + shift) / MARKERS_PER_CURVE * (time[-1] - time[0])
    return [int(point) for point in np.unique(np.searchsorted(time, marker_times))]


def _draw_spreads(axes: Axes, lines: Sequence[Line]) -> list[Artist]:
    """Draw bands of standard deviations.

    The axes keep their range, since deviations at the ends of a recording may be hundreds of times larger
    than inside.
    """
    bands = [line.band for line in lines if line.band is not None]
    y_limits = axes.get_ylim() if bands else None
    for band in bands:
        axes.fill_between(band.time, band.low, band.high, color=line_style(band.style_index).color, **_SPREAD)
    if y_limits is None:
        return []
    axes.set_ylim(y_limits)
    return [Patch(facecolor="0.5", **_SPREAD, label=UNCERTAIN)]


def _draw_corridors(axes: Axes, chart: Chart) -> list[Artist]:
    """Draw attainable ranges of the stiffness, as far as they are visible."""
    bands = [line.band for line in chart.lines if line.band is not None]
    bottom, top = chart.shown or axes.get_ylim()
    for time, low, high, _ in bands:
        area = np.maximum(low, bottom), np.minimum(high, top)
        axes.fill_between(time, *area, ~np.isnan(low), **_AREA)
        for edge in (low, high):
            axes.plot(time, np.where(np.isinf(edge), np.nan, edge), **scaled(_EDGE))
    return [Patch(**_AREA, label=ATTAINABLE)] if bands else []


def _draw_limits(axes: Axes, limits: Sequence[Limit]) -> list[Artist]:
    """Draw bounds of curves already drawn; extend the axis for bounds nearly in sight, write distant ones."""
    low, high = axes.get_ylim()
    reach = LIMIT_SIGHT * (high - low)
    bounds = sorted({(limit.style_index, limit.value) for limit in limits})
    visible = [(look, value) for look, value in bounds if low - reach <= value <= high + reach]
    for look, value in visible:
        axes.axhline(value, color=line_style(look).color, **scaled(_LIMIT))
        low, high = min(low, value - LIMIT_ROOM * reach), max(high, value + LIMIT_ROOM * reach)
    if visible:
        axes.set_ylim(low, high)
    distant = [value for bound in bounds if bound not in visible for value in bound[1:]]
    if distant:
        words = "limits" if len(distant) > 1 else "limit"
        text = f"{words} beyond the axis: {', '.join(f'{value:.4g}' for value in distant)}"
        position, alignment = _free_corner(axes)
        _write_inside(axes, position, text, **alignment)
    return [Line2D([], [], color="0.4", **scaled(_LIMIT), label="limit")] if visible else []


def _free_corner(axes: Axes) -> tuple[tuple[float, float], dict[str, str]]:
    """Return the corner of a panel with the fewest points of curves, and the alignment of text there."""
    to_panel = axes.transData + axes.transAxes.inverted()
    lines = [np.asarray(line.get_xydata()) for line in axes.lines]
    points = [to_panel.transform(line) for line in lines if len(line) > 2]

    def points_in_corner(corner: tuple[str, str]) -> int:
        x_threshold, y_threshold = (0.5 - NOTE_SIZE[0], 0.5 - NOTE_SIZE[1])
        signs = np.array([1 if corner[0] == "right" else -1, 1 if corner[1] == "top" else -1])
        return sum(
            int(((curve_points - 0.5) * signs > (x_threshold, y_threshold)).all(axis=1).sum())
            for curve_points in points
        )

    ha, va = min(product(("right", "left"), ("top", "bottom")), key=points_in_corner)
    position = (0.98 if ha == "right" else 0.02, 0.97 if va == "top" else 0.03)
    return position, {"ha": ha, "va": va}


class _JointFailures(NamedTuple):
    """Failures of one joint in one file, with the color of its curve."""

    time: FloatArray
    infeasible: BoolArray
    singular: BoolArray
    color: str

    @classmethod
    def of(cls, failures: Failures, joint: int, color: str) -> _JointFailures:
        return cls(failures.time, failures.infeasible[joint], failures.singular[joint], color)


def _mark_failures(axes: Axes, chart: Chart) -> list[Artist]:
    """Mark infeasible and singular samples: behind the curve of one joint, below curves of several joints.

    A band over the full height would make all joints of the panel look infeasible.
    """
    colors = {(line.file, line.joint): line_style(line.style_index).color for line in chart.lines}
    all_failing = [
        _JointFailures.of(failures, joint, colors[file, joint])
        for file, (failures, joints) in enumerate(chart.failures)
        for joint in joints
        if (file, joint) in colors
    ]
    failing = [
        joint_failing
        for joint_failing in all_failing
        if joint_failing.infeasible.any() or joint_failing.singular.any()
    ]
    if len(all_failing) == 1:
        return [
            handle
            for joint_failing in failing
            for handle in _shade(axes, joint_failing, (0.0, 1.0), _INFEASIBLE)
        ]
    low, high = axes.get_ylim()
    if failing:
        axes.set_ylim(
            low - (high - low) * STRIP * (len(failing) + 1) / (1 - STRIP * (len(failing) + 1)), high
        )
    handles: list[Artist] = []
    for rank, joint_failing in enumerate(reversed(failing)):
        style = {
            **_INFEASIBLE,
            "facecolor": joint_failing.color,
            "edgecolor": joint_failing.color,
            "linewidth": 0.8,
        }
        handles += _shade(
            axes, joint_failing, (STRIP * (rank + 0.1), STRIP * 0.8), style, ", by color of joint"
        )
    return handles


def _shade(
    axes: Axes,
    failing: _JointFailures,
    band_extent: tuple[float, float],
    infeasible: dict[str, Any],
    color_clause: str = "",
) -> list[Artist]:
    """Draw bands at samples that are infeasible (filled) or singular (hatched).

    Args:
        axes: panel to draw into.
        failing: failures to mark.
        band_extent: lower edge and height of the bands, relative to the height of the panel.
        infeasible: appearance of infeasible samples.
        color_clause: clause on the color, for the legend.

    Returns:
        Legend entries of the bands.
    """
    handles: list[Artist] = []
    kinds: tuple[tuple[BoolArray, dict[str, Any], dict[str, Any], str], ...] = (
        (failing.infeasible, infeasible, _INFEASIBLE, "infeasible"),
        (failing.singular, _SINGULAR, _SINGULAR, "singular"),
    )
    for marked, style, legend_style, label in kinds:
        if marked.any():
            time_spans = [(start, end - start) for start, end in marked_spans(failing.time, marked).tolist()]
            axes.broken_barh(
                time_spans, band_extent, transform=axes.get_xaxis_transform(), label=label, **style
            )
            handles.append(Patch(**legend_style, label=label + color_clause))
    return handles


class _ClippedPeak(NamedTuple):
    """The extreme point of an interval in which a curve leaves the panel."""

    time: float
    value: float
    color: str


def _mark_peaks(axes: Axes, lines: Sequence[Line], floor: float) -> list[Artist]:
    """Mark the peaks of near-singular samples that are cut off; `floor` is the lower end of the curves."""
    time = lines[0].curve.time
    middle = (time[0] + time[-1]) / 2
    low, high = axes.get_ylim()
    edges = ((floor - low) / (high - low) + MARK_DEPTH, 1 - MARK_DEPTH)
    for sign, end, edge in zip((-1, 1), (floor, high), edges, strict=True):
        peaks = [peak for line in lines for peak in _peaks(line, sign, end)]
        if peaks:
            _mark_at_edge(axes, peaks, sign, middle, edge)
    return [Line2D([], [], marker="^", color="0.4", **scaled(_MARK), label="cut off, near-singular")]


def _peaks(line: Line, sign: int, end: float) -> list[_ClippedPeak]:
    """Return the extreme point of each interval beyond one end of the panel."""
    time, values, color = line.curve.time, line.curve.values, line_style(line.style_index).color
    heights = np.where(np.isnan(values), -np.inf, sign * values)
    changes = np.flatnonzero(np.diff(heights > sign * end, prepend=False, append=False))
    spans = changes.reshape(-1, 2).tolist()
    points = [start + int(np.argmax(heights[start:stop])) for start, stop in spans]
    return [_ClippedPeak(float(time[index]), float(values[index]), color) for index in points]


def _mark_at_edge(axes: Axes, peaks: Sequence[_ClippedPeak], sign: int, middle: float, edge: float) -> None:
    """Draw a triangle for each peak at an edge of the panel, and write the value of the largest."""
    transform = axes.get_xaxis_transform()
    marker = "^" if sign > 0 else "v"
    for peak in peaks:
        axes.plot([peak.time], [edge], transform=transform, color=peak.color, marker=marker, **scaled(_MARK))
    farthest = max(peaks, key=lambda peak: sign * peak.value)
    at_right, value = farthest.time > middle, farthest.value
    axes.annotate(
        f"{value:.0f}" if 1000 <= abs(value) < 1e6 else f"{value:.3g}",  # avoids exponents
        (farthest.time, edge),
        (-6 if at_right else 6, 0),
        xycoords=transform,
        textcoords="offset points",
        ha="right" if at_right else "left",
        va="top" if sign > 0 else "bottom",
        fontsize=current_look().points(SMALL),
        color=farthest.color,
        bbox=_BACKGROUND,
    )
