"""A recorded signal next to the spline that stands for it, as figures show them: plain curves and numbers."""

from __future__ import annotations

from typing import NamedTuple

from vsacli.base.arrays import FloatArray
from vsacli.results.curves import Curve


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
