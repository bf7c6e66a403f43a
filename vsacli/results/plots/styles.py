"""Appearance of all panels: settings of Matplotlib, line styles, and names that fit and are legible.

The first line styles are the paper's, continued for any number of joints. Characters that Matplotlib's own
font lacks are drawn in a font of this machine, or else as escape codes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import matplotlib
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.font_manager import FontEntry, findfont, fontManager, get_font
from matplotlib.lines import Line2D
from matplotlib.text import Text

from vsacli.results.charts.chart import DIFFERENCE, LIMIT_STYLE
from vsacli.results.charts.look import current_look, drawing_with

if TYPE_CHECKING:
    from matplotlib.typing import RcKeyType

TICK_SIZE = 9
"""Size of the labels of ticks at the usual font size, points."""

SETTINGS: dict[RcKeyType, Any] = {
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.labelsize": 10,
    "legend.fontsize": 9.5,
    "xtick.labelsize": TICK_SIZE,
    "ytick.labelsize": TICK_SIZE,
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

TEXT_SIZES: tuple[RcKeyType, ...] = (
    "font.size",
    *("axes.titlesize", "axes.labelsize", "legend.fontsize", "xtick.labelsize", "ytick.labelsize"),
)
"""Sizes of texts, which follow the font size of the look but stay legible."""

SCALED_SETTINGS: tuple[RcKeyType, ...] = (
    *("lines.linewidth", "lines.markersize", "lines.markeredgewidth", "axes.linewidth", "grid.linewidth"),
    *("xtick.major.size", "ytick.major.size", "xtick.major.width", "ytick.major.width", "patch.linewidth"),
    *("figure.constrained_layout.h_pad", "figure.constrained_layout.w_pad"),
)
"""Other settings that follow the font size of the look."""

LONGEST_LABEL = 36
"""Maximum length of a name in a legend, characters."""

# Black, red and blue are the paper's; all colors are distinct for color-blind readers.
_COLORS = ("black", "#d8261c", "#1f4fd8", "#009e73", "#e69f00", "#9b4f96", "#56b4e9", "#8c564b")
# One more than the colors, so that pairs repeat only after 72 joints.
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
    """Color, dashes and marker of a line, in Matplotlib's terms."""

    color: str
    linestyle: str
    marker: str

    @property
    def line_kwargs(self) -> dict[str, Any]:
        """Keyword arguments for a line."""
        return {**dataclasses.asdict(self), "markerfacecolor": "none"}


def line_style(index: int) -> LineStyle:
    """Return the style of a look: 0 solid black, 1 dashed red, 2 blue with +, and so on."""
    if index == DIFFERENCE:
        return LineStyle(_COLORS[2], "-", "")
    if index == LIMIT_STYLE:
        return LineStyle("0.3", "-", "")
    return LineStyle(_COLORS[index % len(_COLORS)], *_STROKES[index % len(_STROKES)])


def shortened(name: str, length: int = LONGEST_LABEL) -> str:
    """Shorten a name in its middle to a length that fits a figure, since names often differ at their ends."""
    tail = length // 2
    return name if len(name) <= length else name[: length - tail - 1] + "…" + name[-tail:]


@contextmanager
def house_style() -> Iterator[None]:
    """Draw with these settings and the current look alone, regardless of a matplotlibrc on this machine."""
    look = current_look()
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(SETTINGS)
        matplotlib.rcParams.update({name: look.points(matplotlib.rcParams[name]) for name in TEXT_SIZES})
        matplotlib.rcParams.update({name: look.scale * matplotlib.rcParams[name] for name in SCALED_SETTINGS})
        yield


@contextmanager
def new_figure(natural: tuple[float, float]) -> Iterator[Figure]:
    """Yield an empty figure to draw with the settings of `house_style`.

    Args:
        natural: size of the figure at the usual font size, inches, to which the font is fitted.
    """
    with drawing_with(current_look().fitted(natural)), house_style():
        yield Figure(current_look().size(natural), layout="constrained")


SIZES = ("linewidth", "markersize")
"""Properties of lines in points."""


def scaled(style: Mapping[str, Any]) -> dict[str, Any]:
    """Return a style whose widths of lines and sizes of markers follow the font size of the current look."""
    scale = current_look().scale
    return {name: scale * value if name in SIZES else value for name, value in style.items()}


def line_handle(style: LineStyle, label: str) -> Artist:
    """Return the legend entry of a curve."""
    return Line2D([], [], **style.line_kwargs, label=label)


DEFAULT_FONT = "DejaVu Sans"
"""Default font, included in Matplotlib."""

FALLBACK_PREFIX = "Last Resort"
"""Beginning of the name of a fallback font, which draws the same symbol for all letters of a script."""

REGULAR_WEIGHT = 400
"""Font weight that is neither bold nor light."""


def make_legible(figure: Figure) -> None:
    """Add fonts for characters missing in the default font; characters in no font become escape codes.

    Otherwise two names in a script without an installed font would look the same, as rows of boxes.
    """
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        missing = frozenset(text.get_text()) - usual_letters()
        if missing:
            _make_legible(text, missing)


def _make_legible(text: Text, missing: frozenset[str]) -> None:
    fonts = further_fonts(missing)
    text.set_fontfamily([DEFAULT_FONT, *(name for name, _ in fonts)])
    supplied = frozenset("").union(*(letters for _, letters in fonts))
    escaped = text.get_text()
    for letter in missing - supplied:
        escaped = escaped.replace(letter, letter.encode("unicode_escape").decode("ascii"))
    text.set_text(escaped)


@cache
def usual_letters() -> frozenset[str]:
    """Return the characters of the default font, and the line feed."""
    return _letters(findfont(DEFAULT_FONT)) | {"\n"}


@cache
def further_fonts(missing: frozenset[str]) -> tuple[tuple[str, frozenset[str]], ...]:
    """Return names of installed fonts for these characters, each with the characters that it supplies."""
    fonts = []
    for entry in installed_fonts():
        if not missing:
            break
        supplied = missing & _letters(entry.fname)
        if supplied:
            fonts.append((entry.name, supplied))
            missing -= supplied
    return tuple(fonts)


def installed_fonts() -> Iterator[FontEntry]:
    """Return the fonts of this machine, upright regular ones first."""
    entries = sorted(
        fontManager.ttflist,
        key=lambda entry: (entry.weight != REGULAR_WEIGHT, entry.style != "normal", entry.name, entry.fname),
    )
    return (entry for entry in entries if not entry.name.startswith(FALLBACK_PREFIX))


@cache
def _letters(path: str) -> frozenset[str]:
    """Return the characters of a font; none for color bitmap fonts, which have no outlines."""
    try:
        font = get_font(path)
        font.set_size(10, 72)
        return frozenset(map(chr, font.get_charmap()))
    except (OSError, RuntimeError):
        return frozenset()
