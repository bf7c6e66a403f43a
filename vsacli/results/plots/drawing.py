"""What every panel is drawn with: line styles, fonts, curves that break at gaps, bands where steps fail.

The first line styles are the paper's, continued to any number of joints.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.results.envelopes import marked_spans

if TYPE_CHECKING:
    from matplotlib.typing import RcKeyType

SETTINGS: dict[RcKeyType, Any] = {
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.labelsize": 10,
    "legend.fontsize": 9.5,
    "xtick.labelsize": 9,
    "ytick.labelsize": 9,
    "lines.linewidth": 1.5,
    "lines.markersize": 5,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.xmargin": 0.0,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.handlelength": 2.8,
    "legend.columnspacing": 1.6,
    "figure.constrained_layout.h_pad": 0.06,
    "savefig.dpi": 220,
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "vsacli",
}

LONGEST_LABEL = 36
"""Characters of a name that fit into a legend."""

# Black, red and blue are the paper's; with the others each remains apart for colour-blind readers.
_COLORS = ("black", "#d8261c", "#1f4fd8", "#009e73", "#e69f00", "#9b4f96", "#56b4e9", "#8c564b")
# One more than the colours, so that the pairs repeat only after 72 joints.
_STROKES = (
    ("-", ""),
    ("--", ""),
    ("-", "+"),
    ("-.", ""),
    (":", ""),
    ("-", "o"),
    ("--", "s"),
    ("-", "x"),
    ("-.", "^"),
)


@dataclass(frozen=True)
class LineStyle:
    """Colour, dashes and marker of a line, in matplotlib's words."""

    color: str
    linestyle: str
    marker: str

    @property
    def words(self) -> dict[str, Any]:
        """Keyword arguments of a line."""
        return {**dataclasses.asdict(self), "markerfacecolor": "none"}


def line_style(index: int) -> LineStyle:
    """Style of the joint (or result) `index` from 0: solid black, dashed red, blue with +, and so on."""
    return LineStyle(_COLORS[index % len(_COLORS)], *_STROKES[index % len(_STROKES)])


def shortened(name: str, length: int = LONGEST_LABEL) -> str:
    """A name cut in its middle to a length a figure can hold; names often differ at their ends."""
    tail = length // 2
    return name if len(name) <= length else name[: length - tail - 1] + "…" + name[-tail:]


@contextmanager
def house_style() -> Iterator[None]:
    """Draw with these settings alone, whatever a matplotlibrc on this machine says."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(SETTINGS)
        yield


MARKERS_PER_CURVE = 8
MARKER_STAGGER = 0.37
"""Shift of the markers from curve to curve, in marker distances: those of coinciding curves stay apart."""

# Opaque and edged: bands do not darken where they meet, and a single step stays visible.
_INFEASIBLE_BAND = {"facecolor": "0.8", "edgecolor": "0.8", "linewidth": 1.5, "zorder": 0.5}
_SPREAD: dict[str, Any] = {"alpha": 0.3, "linewidth": 0}
_SINGULAR_BAND = {"facecolor": "none", "edgecolor": "0.45", "linewidth": 0.8, "hatch": "////", "zorder": 0.6}


_LIMIT: dict[str, Any] = {"linewidth": 0.8, "linestyle": (0, (1, 2))}

LIMIT_SIGHT = 1.5
"""Limits beyond what is shown by this factor are not drawn: curves would become flat."""


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


def draw_limits(axes: Axes, bounds: Mapping[int, float]) -> list[Artist]:
    """Draw what the size of curves is bounded by, those that are in sight or nearly so.

    Args:
        axes: where to draw, with all curves.
        bounds: by number of the curve, which gives the colour; not finite where there is none.

    Returns:
        What a legend shows for them.
    """
    low, high = axes.get_ylim()
    seen = LIMIT_SIGHT * max(-low, high)
    drawn = {index: bound for index, bound in bounds.items() if bound <= seen}
    for index, bound in drawn.items():
        for end in (-bound, bound):
            if low - (high - low) / 2 <= end <= high + (high - low) / 2:
                axes.axhline(end, color=line_style(index).color, **_LIMIT)
    return [Line2D([], [], color="0.4", **_LIMIT, label="limit")] if drawn else []


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
