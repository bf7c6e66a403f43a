"""Charts of measured against computed signals, and the curves of recorded signals and their splines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.results.charts.chart import DIFFERENCE, PANEL_WIDTH, Chart, Line, PanelGrid, Sheet
from vsacli.results.charts.reduction import Curve

MOST_ROWS = 8
ROW_HEIGHT = 1.6
"""Height of a row of panels, inches."""


class MeasuredCurve(NamedTuple):
    """A signal, measured and computed.

    Attributes:
        name: name of the signal.
        unit: unit of the values.
        rms: root mean square of measured minus computed values.
        time: times, (samples,), s.
        computed, measured: values, (samples,).
    """

    name: str
    unit: str
    rms: float
    time: FloatArray
    computed: FloatArray
    measured: FloatArray

    def charts(self, computed: str = "computed") -> tuple[Chart, Chart]:
        """Return measured and computed values in one chart, and measured minus computed values in another.

        Args:
            computed: label of the curve compared with the measured one.
        """
        overlay = [
            Line(Curve.reduced(self.time, values), style_index, label, style_index, role=role)
            for style_index, (label, role, values) in enumerate(
                ((computed, "computed", self.computed), ("measured", "measured", self.measured))
            )
        ]
        difference = Curve.reduced(self.time, self.measured - self.computed)
        difference_line = Line(difference, DIFFERENCE, f"measured minus {computed}", 2, rms=self.rms)
        return (
            Chart(self.name, self.unit, overlay, axis=f"[{self.unit}]"),
            Chart(f"difference, rms {self.rms:.3g} {self.unit}", self.unit, [difference_line], zero=True),
        )


def measured_sheet(curves: Sequence[MeasuredCurve], title: str, computed: str = "computed") -> Sheet:
    """Return a figure with two panels for each signal.

    Args:
        curves: signals to draw.
        title: title of the figure.
        computed: label of the curves compared with the measured ones.
    """
    time = np.array([min(c.time[0] for c in curves), max(c.time[-1] for c in curves)])
    block = PanelGrid(time, [curve.charts(computed) for curve in curves], (ROW_HEIGHT,), MOST_ROWS)
    size = (PANEL_WIDTH * block.columns, block.height + 1)
    legend = {computed: 0, "measured": 1, f"measured minus {computed}": DIFFERENCE}
    return Sheet(title, size, legend, [block])


class AmplitudeSpectrum(NamedTuple):
    """Amplitude densities of a recording, in its unit per square root of Hz.

    Attributes:
        frequencies: center frequencies of bands, (bands,), Hz.
        recorded: density of the samples, (bands,).
        fitted: density of the spline at the same times, (bands,).
        noise: density of white noise of the reported size; 0 if none is reported.
        cutoff: frequency up to which the spline follows the samples, Hz; NaN if it follows all of them.
        above: frequency above which low-pass filtered noise dominates, Hz; NaN if there is none.
    """

    frequencies: FloatArray
    recorded: FloatArray
    fitted: FloatArray
    noise: float
    cutoff: float
    above: float


class HighestDerivative(NamedTuple):
    """The highest derivative of a signal that is needed.

    Attributes:
        name: name of the derivative, such as "d4q".
        unit: unit of the values.
        order: order of the derivative.
        deviation: reported standard deviation, relative to the root mean square of the values; NaN if not
            reported.
    """

    name: str
    unit: str
    order: int
    deviation: float


class RecordedCurve(NamedTuple):
    """A component of a recorded signal.

    Attributes:
        name: name of the component, such as elbow.q.
        unit: unit of the values.
        fit: short description of the kind of spline.
        knots: number of knots of the spline.
        recorded: curve of the samples.
        fitted: curve of the spline over the same time.
        residual: samples minus spline.
        rms: root mean square of the residual.
        noise: reported standard deviation of a sample.
        inside: times between which the derivatives of the spline are reliable, s.
        spectrum: spectra of samples and spline.
        highest: highest derivative that is needed.
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
    spectrum: AmplitudeSpectrum
    highest: HighestDerivative
