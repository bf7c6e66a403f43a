"""Charts of measured signals over computed ones, and the curves of recorded signals and their splines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.results.charts.chart import DIFFERENCE, PANEL_WIDTH, Block, Chart, Line, Sheet
from vsacli.results.charts.reduction import Curve

MOST_ROWS = 8
ROW_HEIGHT = 1.6
"""Inches."""


class MeasuredCurve(NamedTuple):
    """A signal as it was measured and computed.

    Attributes:
        name: of the signal.
        unit: of its values.
        rms: root mean square of measured minus computed.
        time: (samples,), s.
        computed, measured: (samples,).
    """

    name: str
    unit: str
    rms: float
    time: FloatArray
    computed: FloatArray
    measured: FloatArray

    def charts(self, computed: str = "computed") -> tuple[Chart, Chart]:
        """Return measured over computed values, and measured minus computed ones.

        Args:
            computed: name of the curve that is compared with the measured one.
        """
        over = [
            Line(Curve.reduced(self.time, values), look, label, look, role=role)
            for look, (label, role, values) in enumerate(
                ((computed, "computed", self.computed), ("measured", "measured", self.measured))
            )
        ]
        difference = Curve.reduced(self.time, self.measured - self.computed)
        apart = Line(difference, DIFFERENCE, f"measured minus {computed}", 2, rms=self.rms)
        return (
            Chart(self.name, self.unit, over, axis=f"[{self.unit}]"),
            Chart(f"difference, rms {self.rms:.3g} {self.unit}", self.unit, [apart], zero=True),
        )


def measured_sheet(curves: Sequence[MeasuredCurve], title: str) -> Sheet:
    """Return a figure with two panels for each signal."""
    columns = 2 * math.ceil(len(curves) / MOST_ROWS)
    rows = math.ceil(2 * len(curves) / columns)
    time = np.array([min(c.time[0] for c in curves), max(c.time[-1] for c in curves)])
    block = Block(time, [curve.charts() for curve in curves], MOST_ROWS)
    size = (PANEL_WIDTH * columns, ROW_HEIGHT * rows + 1)
    return Sheet(title, size, {"computed": 0, "measured": 1}, [block])


class Spectrum(NamedTuple):
    """Amplitude densities of a recording, in its unit per root of Hz.

    Attributes:
        frequencies: centers of bands, (bands,), Hz.
        recorded: of the samples, (bands,).
        fitted: of the spline at the same times, (bands,).
        noise: of white noise as large as the report states; 0 if it states none.
        cutoff: frequency up to which the spline follows the samples, Hz; NaN if it follows all of them.
        above: frequency above which noise that a filter made smooth prevails, Hz; NaN if there is none.
    """

    frequencies: FloatArray
    recorded: FloatArray
    fitted: FloatArray
    noise: float
    cutoff: float
    above: float


class Highest(NamedTuple):
    """The highest derivative of a signal that is needed.

    Attributes:
        name: such as "d4q".
        unit: of its values.
        order: of the derivative.
        deviation: of its values over their root mean square, as the report states it; NaN if it does not.
    """

    name: str
    unit: str
    order: int
    deviation: float


class RecordedCurve(NamedTuple):
    """A component of a recorded signal.

    Attributes:
        name: of the component, such as elbow.q.
        unit: of its values.
        fit: the kind of spline in a few words.
        knots: of the spline.
        recorded: the samples.
        fitted: the spline between the same times.
        residual: samples minus spline.
        rms: root mean square of the residual.
        noise: standard deviation of a sample, as the report states it.
        inside: times between which the derivatives of the spline can be relied on, s.
        spectrum: of samples and spline.
        highest: the highest derivative that is needed.
    """

    name: str
    unit: str
    fit: str
    knots: int
    recorded: Curve
    fitted: Curve
    residual: Curve
    rms: float
    noise: float
    inside: tuple[float, float]
    spectrum: Spectrum
    highest: Highest
