"""The look of figures: their size, fonts and titles, for a screen, a page of a journal, or a slide.

A look applies to everything that is drawn within `drawing_with`. Sizes of fonts, lines and panels follow from
the font size; figures are as wide as the look demands, with fewer panels side by side where it is narrow.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace

from vsacli.base.errors import InputError

USUAL_FONT = 10.0
"""Font size for which sizes of panels and lines are declared, pt."""

CM_PER_INCH = 2.54

SIZES, FONTS, RESOLUTIONS = (2.0, 200.0), (4.0, 72.0), (20.0, 1200.0)
"""Smallest and largest width or height, cm, font size, pt, and resolution of PNG figures, dots per inch."""

LEGIBLE = 7.0
"""Smallest size of texts, pt, unless the font size itself is smaller."""

SQUEEZE = 1.1
"""Largest ratio of the font size to that with which panels have their declared size."""


@dataclass(frozen=True)
class Look:
    """The look of figures.

    Attributes:
        width, height: size, cm; None: as the content requires.
        font_size: size of most texts, pt.
        title: whether figures have a title.
        dpi: resolution of PNG figures, dots per inch; None: the usual one.
    """

    width: float | None = None
    height: float | None = None
    font_size: float = USUAL_FONT
    title: bool = True
    dpi: float | None = None

    def __post_init__(self) -> None:
        for value, (least, most), unit in (
            (self.width, SIZES, "cm"),
            (self.height, SIZES, "cm"),
            (self.font_size, FONTS, "pt"),
            (self.dpi, RESOLUTIONS, "dots per inch"),
        ):
            if value is not None and not least <= value <= most:
                raise InputError.one(f"must be from {least:g} to {most:g} {unit}, not {value:g} {unit}")

    @property
    def scale(self) -> float:
        """Size of fonts, lines and panels relative to the declared ones."""
        return self.font_size / USUAL_FONT

    def points(self, declared: float) -> float:
        """Return the size, pt, of a text that has the declared one at the usual font size."""
        return max(self.scale * declared, min(LEGIBLE, self.font_size))

    def fitted(self, natural: tuple[float, float]) -> Look:
        """Return the look with the font with which a figure of this natural size fits into width and height.

        Without a fixed height the font stays, since a figure may then become taller instead.
        """
        if self.width is None or self.height is None:
            return self
        available_scale = min(self.width / natural[0], self.height / natural[1]) / CM_PER_INCH
        return replace(
            self, font_size=max(FONTS[0], min(self.font_size, USUAL_FONT * SQUEEZE * available_scale))
        )

    def size(self, natural: tuple[float, float]) -> tuple[float, float]:
        """Return width and height, inches, of a figure that is declared with these at the usual font size."""
        fixed_size = (self.width, self.height)
        width, height = (
            self.scale * inches if cm is None else cm / CM_PER_INCH
            for inches, cm in zip(natural, fixed_size, strict=True)
        )
        return width, height


STYLES = {
    "screen": Look(),
    "paper": Look(width=8.9, font_size=7.5, title=False),
    "slide": Look(width=25.4, height=14.29, font_size=16.0),
}
"""Looks by name: the default, a column of a two-column journal (8.9 cm), and a slide of 16:9."""

_LOOK: ContextVar[Look] = ContextVar("look", default=STYLES["screen"])


def current_look() -> Look:
    """Return the look that applies here."""
    return _LOOK.get()


@contextmanager
def drawing_with(look: Look) -> Iterator[None]:
    """Draw figures with a look within this context."""
    token = _LOOK.set(look)
    try:
        yield
    finally:
        _LOOK.reset(token)
