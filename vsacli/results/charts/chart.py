"""A chart: curves over time with their bands, bounds and gaps; and sheets of charts.

Charts contain arrays and words, no colors: figures and pages derive the appearance of a curve from its
number. A page shows charts one by one; a figure shows them as panels of a sheet, in blocks side by side.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from vsacli.base.arrays import FLAG_TYPE, BoolArray, FloatArray
from vsacli.base.flags import Flag, has_flag
from vsacli.base.units import TIME
from vsacli.results.charts.reduction import Curve
from vsacli.results.store.reader import StoredResult

PANEL_WIDTH = 3.0
"""Width of a panel, inches: with fonts of 10 pt, two panels side by side stay readable in a column of a
paper."""

DIFFERENCE, LIMIT_STYLE = -1, -2
"""Look of the difference of two curves, distinct from the looks of both; and of a limit of all joints."""

ATTAINABLE, UNCERTAIN = "attainable", "two standard deviations"
"""Meanings of bands."""

APPROACH = 0.02
"""Time before and after a failing or near-singular sample in which quantities may already be very large,
relative to the duration."""

DEVIATIONS = 2
"""Half-width of the band around a curve, in standard deviations."""


class ShadedArea(NamedTuple):
    """Area around a curve: times, lower and upper edge, each (points,), and number of its look in figures."""

    time: FloatArray
    low: FloatArray
    high: FloatArray
    style_index: int

    @classmethod
    def around(cls, curve: Curve, deviation: FloatArray, style_index: int) -> ShadedArea | None:
        """Return the band of a curve for a standard deviation, (points,); None if that is NaN throughout."""
        if np.isnan(deviation).all():
            return None
        half_width = DEVIATIONS * deviation
        return cls(curve.time, curve.values - half_width, curve.values + half_width, style_index)


class Line(NamedTuple):
    """A curve of a chart.

    Attributes:
        curve: points of the curve.
        style_index: number of color and dashes in figures, or `DIFFERENCE`.
        label: name of the joint or of the component of a wrench.
        color: number of the color on pages.
        joint: number of the joint, from 0; None if the curve belongs to no joint.
        file: number of the file, from 0.
        role: "computed", "commanded", "simulated" or "measured".
        band: area around the curve, if there is one.
        rms: root mean square of a difference; None for other curves.
    """

    curve: Curve
    style_index: int
    label: str = ""
    color: int = 0
    joint: int | None = None
    file: int = 0
    role: str = "computed"
    band: ShadedArea | None = None
    rms: float | None = None


class Limit(NamedTuple):
    """A bound of the curve of a joint; `style_index` is the number of its look in figures."""

    style_index: int
    joint: int
    value: float


@dataclass(frozen=True)
class Failures:
    """Samples that cannot be executed, or are near-singular.

    Attributes:
        time: times, (samples,), s.
        infeasible, singular: flags, (joints, samples).
        near_singular: flags of feasible samples near a singularity, where some quantities become very large,
            (joints, samples).
    """

    time: FloatArray
    infeasible: BoolArray
    singular: BoolArray
    near_singular: BoolArray

    @classmethod
    def of(cls, result: StoredResult) -> Failures:
        """Return the failures flagged in a result; none if it was stored without flags."""
        time = result.time
        if "flags" not in result.variables:
            no_flags = np.zeros((len(result.joint_names), time.size), dtype=np.bool_)
            return cls(time, no_flags, no_flags, no_flags)
        flags = np.ascontiguousarray(result.read("flags").T, dtype=FLAG_TYPE)
        return cls(
            time, *(has_flag(flags, flag) for flag in (Flag.INFEASIBLE, Flag.SINGULAR, Flag.NEAR_SINGULAR))
        )

    def calm(self, joint: int, time: FloatArray) -> BoolArray:
        """Return where no sample of a joint fails or is near-singular within `APPROACH`; (points,).

        Torques grow towards a singularity already at samples whose margin is still large enough.
        """
        is_near = self.infeasible[joint] | self.singular[joint] | self.near_singular[joint]
        near_counts = np.append(0, np.cumsum(is_near))
        half_width = APPROACH * (self.time[-1] - self.time[0])
        last_sample = self.time.size - 1
        # The samples next to each time are included, however far apart samples are.
        previous_sample = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, last_sample)
        next_sample = np.minimum(np.searchsorted(self.time, time), last_sample)
        first_sample = np.minimum(np.searchsorted(self.time, time - half_width), previous_sample)
        end_sample = np.maximum(np.searchsorted(self.time, time + half_width, side="right"), next_sample + 1)
        calm: BoolArray = near_counts[end_sample] == near_counts[first_sample]
        return calm


@dataclass(frozen=True)
class Chart:
    """A plot over time.

    Attributes:
        title: title in words; empty for none.
        unit: unit of the values.
        lines: curves of the chart.
        axis: label of the value axis in figures; empty for none.
        name: name of the variable in the file.
        limits: finite bounds.
        shown: initial range of the value axis; None for the range of all curves.
        cut_off: whether peaks of near-singular samples exceed this range.
        band: meaning of the bands around curves.
        from_zero: whether the value axis begins at 0.
        zero: whether a line marks 0, as for differences.
        failures: failures to mark, of each file, each with the joints concerned.
        note: sentence on curves that are missing; empty for none.
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
    note: str = ""


Legend: TypeAlias = Mapping[str, int]
"""Looks of lines by their labels."""

Row: TypeAlias = Sequence[Chart | None]


class PanelGrid(NamedTuple):
    """Panels in rows and columns; the panels of a column share a time axis.

    Attributes:
        time: range of the time axes, (2 or more,), s, ascending.
        rows: charts from top to bottom, in rows of equal length; None for an empty place.
        heights: heights of the rows of a group, inches, at the usual font size; stretched to fill a figure.
        most_rows: number of row groups before the next ones continue to the right; None for no limit.
        beside: legends at the right of the rows; empty for none.
        xlabel: label of the time axis.
    """

    time: FloatArray
    rows: Sequence[Row]
    heights: Sequence[float]
    most_rows: int | None = None
    beside: Sequence[Legend] = ()
    xlabel: str = f"time [{TIME}]"

    @property
    def columns(self) -> int:
        """Number of panels side by side."""
        return self.folding[1] * len(self.rows[0])

    @property
    def height(self) -> float:
        """Height of all rows, inches, at the usual font size."""
        return self.folding[0] * sum(self.heights)

    @property
    def folding(self) -> tuple[int, int]:
        """Number of row groups below each other, and number of such columns of groups."""
        groups = len(self.rows) // len(self.heights)
        return folding(groups, groups if self.most_rows is None else self.most_rows)


class Sheet(NamedTuple):
    """A figure before it is drawn.

    Attributes:
        title: title of the figure.
        size: width and height, inches.
        legend: labels and looks of the legend.
        blocks: blocks of panels, side by side.
        widths: relative widths of the blocks.
    """

    title: str
    size: tuple[float, float]
    legend: Legend
    blocks: Sequence[PanelGrid]
    widths: Sequence[float] = (1.0,)


def folding(rows: int, most_rows: int) -> tuple[int, int]:
    """Return the number of rows below each other, and of columns into which the rows are folded."""
    group_columns = math.ceil(rows / most_rows)
    return math.ceil(rows / group_columns), group_columns
