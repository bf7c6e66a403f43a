"""What each plot of a page shows: curves over time, by joint and by file, with limits and corridor."""

from __future__ import annotations

from dataclasses import dataclass

from vsacli.base.arrays import FloatArray
from vsacli.base.json_records import Published
from vsacli.results.pages.packing import Packed


@dataclass(frozen=True)
class Series(Published):
    """A curve; arrays go by their numbers.

    Attributes:
        label: what it is of: a joint, or a component of a wrench.
        colour: number of its colour.
        joint: number of the joint; None if it is of none.
        file: number of the file.
        role: "computed", "commanded", "actual" or "measured".
        time: (points,), s after the start of the page.
        values: (points,), NaN where there is none.
        band: what lies around it, the lower and the upper edge, (points,) each; None if nothing does.
        rms: root mean square of a difference; None of anything else.
    """

    label: str
    colour: int
    joint: int | None
    file: int
    role: str
    time: int
    values: int
    band: tuple[int, int] | None = None
    rms: float | None = None


@dataclass(frozen=True)
class Limit(Published):
    """A bound of the curve of a joint."""

    joint: int
    value: float


@dataclass(frozen=True)
class Chart(Published):
    """A plot over time.

    Attributes:
        title: in words.
        name: of the variable, as in the file.
        unit: of its values.
        series: its curves.
        limits: bounds that are finite.
        shown: what of the axis of values is shown at first; None for all curves.
        band: what the bands around curves are; empty without.
        note: what else there is to say; empty if there is nothing.
    """

    title: str
    name: str
    unit: str
    series: tuple[Series, ...]
    limits: tuple[Limit, ...] = ()
    shown: tuple[float, float] | None = None
    band: str = ""
    note: str = ""


@dataclass(frozen=True)
class Banded:
    """A curve of one joint before it is packed; all arrays (points,).

    Attributes:
        time: s.
        values: NaN breaks the curve.
        band: lower and upper edge of what lies around it, None if nothing does.
    """

    time: FloatArray
    values: FloatArray
    band: tuple[FloatArray, FloatArray] | None = None

    def packed(self, packed: Packed, start: float) -> dict[str, object]:
        """The attributes of a `Series` that hold arrays.

        Args:
            packed: what holds them.
            start: time from which the page counts, s.
        """
        band = None if self.band is None else tuple(map(packed.add, self.band))
        return {"time": packed.add(self.time - start), "values": packed.add(self.values), "band": band}
