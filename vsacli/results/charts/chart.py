"""A chart: curves over time with their bands, bounds and interruptions; and sheets of charts.

Charts hold arrays and words, no colors: a curve has a number from which figures and pages derive its look.
A page shows charts one by one, a figure as the panels of a sheet, in blocks side by side.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.flags import Flag, has
from vsacli.base.units import TIME
from vsacli.results.charts.reduction import Curve
from vsacli.results.store.reader import StoredResult

PANEL_WIDTH = 3.0
"""Inches: with fonts of 10 pt, two panels side by side stay readable in one column of a paper."""

DIFFERENCE = -1
"""Look of one curve minus another, which is neither of them."""

REACHABLE, UNCERTAIN = "reachable", "two standard deviations"
"""Meanings of bands."""

DEVIATIONS = 2
"""Standard deviations on each side of a curve that its band holds."""


class Band(NamedTuple):
    """Area around a curve: times, lower and upper edge, each (points,), and its number in figures."""

    time: FloatArray
    low: FloatArray
    high: FloatArray
    look: int

    @classmethod
    def around(cls, curve: Curve, deviation: FloatArray, look: int) -> Band | None:
        """Return the band of a curve with a standard deviation, (points,); None if that is NaN throughout."""
        if np.isnan(deviation).all():
            return None
        spread = DEVIATIONS * deviation
        return cls(curve.time, curve.values - spread, curve.values + spread, look)


class Line(NamedTuple):
    """A curve of a chart.

    Attributes:
        curve: its points.
        look: number of color and stroke in figures, or `DIFFERENCE`.
        label: name of the joint or of the component of a wrench.
        colour: number of its color on pages.
        joint: number of the joint; None if it is of none.
        file: number of the file, from 0.
        role: "computed", "commanded", "simulated" or "measured".
        band: area around it, if there is one.
        rms: root mean square of a difference; None of anything else.
    """

    curve: Curve
    look: int
    label: str = ""
    colour: int = 0
    joint: int | None = None
    file: int = 0
    role: str = "computed"
    band: Band | None = None
    rms: float | None = None


class Limit(NamedTuple):
    """A bound of the curve of a joint; `look` is its number in figures."""

    look: int
    joint: int
    value: float


@dataclass(frozen=True)
class Failures:
    """Samples that cannot be executed, or nearly so.

    Attributes:
        time: (samples,), s.
        infeasible, singular: (joints, samples).
        near_singular: feasible, but quantities that grow without bound are large, (joints, samples).
    """

    time: FloatArray
    infeasible: BoolArray
    singular: BoolArray
    near_singular: BoolArray

    @classmethod
    def of(cls, result: StoredResult) -> Failures:
        """Return the failures a result has flagged; none if it was stored without flags."""
        time = result.time
        if "flags" not in result.variables:
            none = np.zeros((len(result.joint_names), time.size), dtype=np.bool_)
            return cls(time, none, none, none)
        flags = np.ascontiguousarray(result.read("flags").T, dtype=np.uint32)
        return cls(time, *(has(flags, flag) for flag in (Flag.INFEASIBLE, Flag.SINGULAR, Flag.NEAR_SINGULAR)))

    def among(self, joints: Sequence[int]) -> tuple[BoolArray, BoolArray]:
        """Return which samples are infeasible, and which singular, for any of these joints; (samples,)."""
        chosen = list(joints)
        return np.any(self.infeasible[chosen], axis=0), np.any(self.singular[chosen], axis=0)

    def calm(self, joint: int, time: FloatArray) -> BoolArray:
        """Return at which of these times, (points,), a joint is near-singular neither before nor after."""
        last = self.time.size - 1
        before = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, last)
        after = np.minimum(np.searchsorted(self.time, time), last)
        near = self.near_singular[joint]
        calm: BoolArray = ~(near[before] | near[after])
        return calm


@dataclass(frozen=True)
class Chart:
    """A plot over time.

    Attributes:
        title: in words; empty for none.
        unit: of its values.
        lines: its curves.
        axis: label of the axis of values in figures; empty for none.
        name: of the variable, as in the file.
        limits: bounds that are finite.
        shown: range of the axis of values at first; None for all curves.
        cut_off: whether peaks of near-singular samples lie beyond that.
        band: meaning of the bands around curves.
        from_zero: whether the axis of values begins at 0.
        zero: whether a line marks 0, as of differences.
        failures: samples to be shaded, each with the joints of which.
    """

    title: str
    unit: str
    lines: Sequence[Line]
    axis: str = ""
    name: str = ""
    limits: Sequence[Limit] = ()
    shown: tuple[float, float] | None = None
    cut_off: bool = False
    band: str = UNCERTAIN
    from_zero: bool = False
    zero: bool = False
    failures: Sequence[tuple[Failures, Sequence[int]]] = ()


Legend: TypeAlias = Mapping[str, int]
"""Looks of lines by their labels."""

Row: TypeAlias = Sequence[Chart | None]


class Block(NamedTuple):
    """Panels in rows and columns; those of a column share an axis of time.

    Attributes:
        time: range of the axes of time, (2 or more,), s, ascending.
        rows: charts from top to bottom, each row of equal length; None where there is none.
        most_rows: groups of rows below each other before the next begins beside them; None for all.
        heights: of the rows of a group, relative to each other.
        beside: lines named at the right of each row; none if empty.
        xlabel: label of the axis of time.
    """

    time: FloatArray
    rows: Sequence[Row]
    most_rows: int | None = None
    heights: Sequence[float] = (1.0,)
    beside: Sequence[Legend] = ()
    xlabel: str = f"time [{TIME}]"

    @property
    def folding(self) -> tuple[int, int]:
        """Groups of rows below each other, and how often to begin beside them."""
        groups = len(self.rows) // len(self.heights)
        return folding(groups, groups if self.most_rows is None else self.most_rows)


class Sheet(NamedTuple):
    """A figure before it is drawn.

    Attributes:
        title: of the figure.
        size: width and height, inches.
        legend: lines that the legend names.
        blocks: side by side.
        widths: of the blocks, relative to each other.
    """

    title: str
    size: tuple[float, float]
    legend: Legend
    blocks: Sequence[Block]
    widths: Sequence[float] = (1.0,)


def folding(rows: int, most_rows: int) -> tuple[int, int]:
    """Return how many rows stand below each other, and how often to begin beside them."""
    folds = math.ceil(rows / most_rows)
    return math.ceil(rows / folds), folds
