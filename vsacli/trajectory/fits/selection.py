"""Which spline stands for recorded samples: one through them, or a smoother one near them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.base.progress import Progress, unseen
from vsacli.trajectory.fits.fit import Fit, Part, join
from vsacli.trajectory.fits.judgement import Record, judged, replaced, smooth_part
from vsacli.trajectory.fits.least_squares import best_spans, fit_spline
from vsacli.trajectory.fits.noise import estimated_noise, filtered_noise, typical_noise
from vsacli.trajectory.fits.resolution import KnownNoise

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

LEAST_SQUARES, INTERPOLATE, SMOOTH = "lsq", "interpolate", "smooth"
METHODS = (LEAST_SQUARES, INTERPOLATE, SMOOTH)


@dataclass(frozen=True)
class FitChoice:
    """What the user says of the spline for a signal.

    Attributes:
        method: as in `fit_samples`.
        noise: standard deviation of the samples of each component, None where it is estimated.
        bandwidth: above which there is no motion, Hz; None: the record tells.
    """

    method: str | None = None
    noise: tuple[float | None, ...] | None = None
    bandwidth: float | None = None

    @property
    def deviations(self) -> FloatArray | None:
        """The noise, NaN where it is estimated."""
        return None if self.noise is None else np.array(self.noise, dtype=np.float64)

    def stretched(self, factor: float) -> FitChoice:
        """That of the same course, slower by a factor."""
        return replace(self, bandwidth=None if self.bandwidth is None else self.bandwidth / factor)


AS_IT_ASKS_FOR = FitChoice()
"""Nothing is said: the noise of the samples decides."""

INTERPOLATION_GAIN = {7: (1.0, 1.481, 4.628, 6.957, 37.415), 5: (1.0, 1.376, 4.798)}
"""By degree, for each derivative k: standard deviation at the samples, times step^k, of a spline through
equally spaced samples with independent noise of standard deviation 1."""

LEAST_SQUARES_GAIN = {7: (1.0, 1.823, 4.484, 12.11, 34.37), 5: (1.0, 1.829, 4.538)}
"""By degree, for each derivative k: root mean square over a knot span, times span^k sqrt(samples in a span),
of a least-squares spline near many such samples, far from its ends."""


FEWEST_JUDGED = 32
"""Samples from which on differences tell noise from motion; through fewer, as of a table of set points, the
spline goes whatever they are."""

SMALLEST_SHARE = 1e-3
"""Share of the largest component's derivative against which smaller ones are measured: what is below may be
nothing but rounding of a component that rests."""


def fit_samples(
    time: FloatArray,
    values: FloatArray,
    degree: int,
    order: int,
    method: str | None,
    *,
    noise: FloatArray | None = None,
    bandwidth: float | None = None,
    progress: Progress = unseen,
) -> Fit:
    """Fit splines to samples.

    Args:
        time: (samples,) in s, strictly increasing, more than `degree`.
        values: (components, samples); a component that is NaN throughout gets no spline.
        degree: of the splines, 5 or 7.
        order: of the highest derivative that is needed.
        method: `LEAST_SQUARES`, `INTERPOLATE`, `SMOOTH`, or None: for each component by its noise. Splines go
            through samples whose noise, as estimated from their differences, makes up less than 1 % of the
            highest derivative; for others, and where noise was filtered, stands a smoothing spline.
        noise: standard deviation of the samples of each component, (components,), NaN where none is known.
        bandwidth: above which there is no motion, Hz, if it is known; by default smoothing splines have it.
        progress: opens a bar over the samples of all components.
    """
    present = np.flatnonzero(~np.all(np.isnan(values), axis=1))
    given = np.full(len(values), np.nan) if noise is None else noise
    estimate = np.zeros(len(values))
    estimate[present] = estimated_noise(time, values[present], degree + 1)
    estimate = np.where(np.isnan(given), estimate, given)
    record = Record(
        time,
        values,
        spoilt=np.zeros(len(values)),
        filtered=np.zeros(len(values), dtype=bool),
        order=order,
        known=[KnownNoise(None if np.isnan(each) else each, bandwidth) for each in given.tolist()],
    )
    parts: list[Part] = []
    if method == SMOOTH:
        with progress(len(time) * len(present)) as bar:
            for member in present.tolist():
                parts.append(smooth_part(record, member, degree))
                bar.update(len(time))
        return join(degree, parts, time, values, estimate, given)
    if present.size and method == LEAST_SQUARES:
        parts += _least_squares(time, values, present, degree)
    elif present.size:
        parts.append(_interpolation(time, values, present, degree))
    if present.size and method != LEAST_SQUARES and len(time) >= FEWEST_JUDGED:
        typical = typical_noise(time, values[present], degree + 1)
        expected = np.where(np.isnan(given[present]), typical, given[present])
        record.spoilt[present], least = _spoilt(parts[0].spline, time, values[present], expected, order)
        record = record._replace(least=least)
        record.filtered[present] = filtered_noise(time, values[present], degree + 1)
    fit = join(degree, parts, time, values, estimate, given)
    with progress(len(time) * len(present)) as bar:
        instead = list(judged(record, fit, bar, chosen=method is not None))
    return join(degree, replaced(parts, instead), time, values, estimate, given) if instead else fit


def _interpolation(time: FloatArray, values: FloatArray, members: IndexArray, degree: int) -> Part:
    from scipy.interpolate import make_interp_spline

    return Part(members, make_interp_spline(time, values[members].T, k=degree), exact=True)


def _spoilt(
    spline: BSpline[np.float64], time: FloatArray, rows: FloatArray, noise: FloatArray, order: int
) -> tuple[FloatArray, float]:
    """Share of the highest derivative of a spline through samples that noise makes up, (components,).

    Returns:
        It, and the least derivative that counts as one, root mean square.
    """
    degree, duration = spline.k, time[-1] - time[0]
    step = duration / (len(time) - 1)
    inside = time[degree:-degree] if len(time) > 4 * degree else time
    derivative = np.sqrt(np.mean(spline(inside, nu=order) ** 2, axis=0))
    least = np.abs(rows).max(axis=1) / duration**order
    smallest = SMALLEST_SHARE * float(derivative.max())
    scale = np.maximum(np.maximum(derivative, least), smallest)
    error = INTERPOLATION_GAIN[degree][order] * noise / step**order
    return np.asarray(error / np.maximum(scale, np.finfo(float).tiny)), smallest


def _least_squares(time: FloatArray, values: FloatArray, members: IndexArray, degree: int) -> Iterator[Part]:
    spans = best_spans(time, values[members], degree)
    for count in np.unique(spans).tolist():
        alike = members[spans == count]
        yield Part(alike, fit_spline(time, values[alike], count, degree), exact=False)
