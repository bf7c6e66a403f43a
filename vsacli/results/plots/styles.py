"""What every panel is drawn with: settings of matplotlib, line styles, names that fit.

The first line styles are the paper's, continued to any number of joints.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import matplotlib
from matplotlib.artist import Artist
from matplotlib.lines import Line2D

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


DIFFERENCE = LineStyle(_COLORS[2], "-", "")
"""Of one curve minus another, which is neither of them."""


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


def line_handle(style: LineStyle, label: str) -> Artist:
    """What a legend shows for a curve."""
    return Line2D([], [], **style.words, label=label)
