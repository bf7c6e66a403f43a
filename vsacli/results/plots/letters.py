"""Names in letters that matplotlib's own font has not: in a font of this machine, or else by their codes."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from matplotlib.figure import Figure
from matplotlib.font_manager import FontEntry, findfont, fontManager, get_font
from matplotlib.text import Text

USUAL = "DejaVu Sans"
"""The font that comes with matplotlib."""

SUBSTITUTE = "Last Resort"
"""What the name of the font begins with that draws a picture of its script for every letter."""

REGULAR = 400
"""Weight of a font that is neither bold nor light."""


def make_legible(figure: Figure) -> None:
    """Give texts a further font for what is missing in the usual one; letters that no font has become codes.

    Two names in a script that is nowhere installed would else be two rows of equal boxes.
    """
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        missing = frozenset(text.get_text()) - usual_letters()
        if missing:
            _mend(text, missing)


def _mend(text: Text, missing: frozenset[str]) -> None:
    fonts = further_fonts(missing)
    text.set_fontfamily([USUAL, *(name for name, _ in fonts)])
    drawn = frozenset("").union(*(letters for _, letters in fonts))
    written = text.get_text()
    for letter in missing - drawn:
        written = written.replace(letter, letter.encode("unicode_escape").decode("ascii"))
    text.set_text(written)


@cache
def usual_letters() -> frozenset[str]:
    """What the usual font can draw, and what ends a line."""
    return _letters(findfont(USUAL)) | {"\n"}


@cache
def further_fonts(missing: frozenset[str]) -> tuple[tuple[str, frozenset[str]], ...]:
    """Names of installed fonts that draw some of these letters, each with those that it is for."""
    found = []
    for entry in installed_fonts():
        if not missing:
            break
        here = missing & _letters(entry.fname)
        if here:
            found.append((entry.name, here))
            missing -= here
    return tuple(found)


def installed_fonts() -> Iterator[FontEntry]:
    """Fonts of this machine, upright regular ones first."""
    entries = sorted(
        fontManager.ttflist,
        key=lambda entry: (entry.weight != REGULAR, entry.style != "normal", entry.name, entry.fname),
    )
    return (entry for entry in entries if not entry.name.startswith(SUBSTITUTE))


@cache
def _letters(path: str) -> frozenset[str]:
    """What a font can draw; nothing if it has no outlines, as those of coloured pictures."""
    try:
        font = get_font(path)
        font.set_size(10, 72)
        return frozenset(map(chr, font.get_charmap()))
    except (OSError, RuntimeError):
        return frozenset()
