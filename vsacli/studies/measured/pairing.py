"""Pairs of a computed signal and its measured values: whether either changes, and how much they differ.

Measured values may equal computed ones or be a linear function of them: wrong offsets, units and gains make a
rising line, a reversed sensor a falling one. A line fits many parts of a smooth motion, so it must explain
ten times more than equality does, and a falling line ten times more than a rising one. The difference is the
logarithm of the unexplained part, which is bounded, so that a minority of wrong columns does not decide.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import BoolArray, FloatArray

FEWEST_SAMPLES = 4
"""Smallest number of samples for a comparison of two signals."""

ROUNDING = 1e-8
"""Share of a variable's largest value over all joints below which changes are rounding. Torques of joints at
rest change by 1e-16 to 1e-12 of it, and 1e-8 of a motion is below the resolution of any sensor."""

MAX_RANGE_RATIO = 3.0
"""Limit of values in the search beyond the range of nearly all samples, in units of this range, so that
outliers count little."""

LARGEST = 1e100
"""Limit of measured values, whose squares would overflow otherwise."""

MAX_THINNED_SAMPLES = 20_000
"""Number of samples that suffices to find the approximate shift and exchanged columns."""

NEARLY_ALL = (0.02, 0.98)
"""Quantiles between which nearly all samples lie."""

NORMAL_MEDIAN = 0.6745
"""Median of the absolute value of a normal variable, in standard deviations."""


class Computed(NamedTuple):
    """A computed signal.

    Attributes:
        at: function that returns values at times since the start of the result, NaN outside it and next to
            samples without a value.
        slope: function that returns derivatives at such times.
        error: rms error of interpolation.
        spread: standard deviation.
        moves: whether it changes beyond rounding.
    """

    at: Callable[[FloatArray], FloatArray]
    slope: Callable[[FloatArray], FloatArray]
    error: float
    spread: float
    moves: bool


class Pairing(NamedTuple):
    """A computed signal and its measurement.

    Attributes:
        computed: computed signal.
        duration: duration of the result, s.
        time: ascending times of the measured values, (samples,) in s.
        measured: measured values, (samples,).
    """

    computed: Computed
    duration: float
    time: FloatArray
    measured: FloatArray

    def thinned(self) -> Pairing:
        """Return the pairing with at most `MAX_THINNED_SAMPLES` samples."""
        stride = -(-len(self.time) // MAX_THINNED_SAMPLES)
        return self._replace(time=self.time[::stride], measured=self.measured[::stride])

    def overlap(self, shift: float) -> tuple[FloatArray, BoolArray]:
        """Return computed values at the measured times for a shift, and a mask of those that exist."""
        computed = self.computed.at(self.time - shift)
        return computed, np.isfinite(computed)


def tame(values: FloatArray) -> FloatArray:
    """Return measured values with outliers clipped to a range around the others."""
    limited = np.clip(values, -LARGEST, LARGEST)
    low_quantile, high_quantile = np.quantile(limited, NEARLY_ALL)
    range_margin = MAX_RANGE_RATIO * (high_quantile - low_quantile)
    return (
        limited
        if range_margin == 0
        else np.clip(limited, low_quantile - range_margin, high_quantile + range_margin)
    )


def noise(values: FloatArray) -> float:
    """Return the variance of the white noise of clipped values, from their second differences."""
    second_differences = np.abs(np.diff(values, 2))
    return float(np.median(second_differences) / NORMAL_MEDIAN) ** 2 / 6 if second_differences.size else 0.0


def interpolated(time: FloatArray, values: FloatArray, largest: float) -> Computed:
    """Return a stored signal as a function of the time since its start.

    Args:
        time: times of the samples, (samples,) in s, the first being 0.
        values: values, (samples,), NaN where there is none.
        largest: largest absolute value of the variable over all joints.
    """
    is_finite = np.isfinite(values)
    if np.count_nonzero(is_finite) < FEWEST_SAMPLES:
        return Computed(_undefined_values, _undefined_values, 0.0, 0.0, moves=False)
    sample_times, finite_values = time[is_finite], values[is_finite]
    spline = scipy.interpolate.make_interp_spline(sample_times, finite_values, k=3)
    slope, nan_at_gaps = spline.derivative(), np.where(is_finite, 0.0, np.nan)

    def at(times: FloatArray) -> FloatArray:
        return np.asarray(spline(times) + np.interp(times, time, nan_at_gaps, left=np.nan, right=np.nan))

    return Computed(
        at=at,
        slope=lambda times: np.asarray(slope(times)),
        error=_interpolation_error(sample_times, finite_values),
        spread=float(np.std(finite_values)),
        moves=float(np.ptp(finite_values)) > ROUNDING * largest,
    )


def _undefined_values(times: FloatArray) -> FloatArray:
    return np.full(np.shape(times), np.nan)


def _interpolation_error(time: FloatArray, values: FloatArray) -> float:
    """Return the rms error of a cubic spline."""
    # a spline through every second sample has a 16 times larger error, which the other samples show
    rounding = float(np.finfo(float).eps * np.abs(values).max())
    if len(time) < 2 * FEWEST_SAMPLES:
        return rounding
    odd_samples = slice(1, len(time) - 1, 2)
    coarse_spline = scipy.interpolate.make_interp_spline(time[::2], values[::2], k=3)
    is_inside = time[odd_samples] <= time[::2][-1]
    differences = coarse_spline(time[odd_samples][is_inside]) - values[odd_samples][is_inside]
    return rounding + float(np.sqrt(np.mean(differences**2))) / 16


LINE_PENALTY = math.log(10.0)
"""Penalty for a line, applied twice to a falling one, on the logarithm of the unexplained part."""

MIN_UNEXPLAINED_SHARE = 1e-5
"""Smallest unexplained share of the variance that counts, since the filter of a sensor may cause as much."""

FLAT_VARIANCE_SHARE = 1e-9
"""Share of the variance of a recording below which sums of transforms are rounding."""

MAX_NOISE_SHARE = 0.1
"""Largest share of the variance attributed to noise, since motion with few samples looks like noise."""


class Moments(NamedTuple):
    """Sums over the common samples of computed and measured values, as arrays for many shifts.

    Attributes:
        samples: number of samples.
        computed, measured: sums of the values, each minus a constant.
        computed2, measured2, product: sums of squares and products of these.
        apart: constant of the measured values minus that of the computed ones.
        measured_variance: variance of all measured values.
    """

    samples: FloatArray
    computed: FloatArray
    measured: FloatArray
    computed2: FloatArray
    measured2: FloatArray
    product: FloatArray
    apart: float
    measured_variance: float

    def spreads(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the sums of squares of both about their means, and of their products."""
        return (
            self.computed2 - self.computed**2 / self.samples,
            self.measured2 - self.measured**2 / self.samples,
            self.product - self.computed * self.measured / self.samples,
        )

    def squared_error(self) -> FloatArray:
        """Return the sum of squares of measured minus computed values."""
        errors = self.computed2 - 2 * self.product + self.measured2
        return errors + 2 * self.apart * (self.measured - self.computed) + self.samples * self.apart**2


def moments_of(computed: FloatArray, tamed: FloatArray) -> Moments:
    """Return the sums of computed values, where these are not NaN, and measured ones at the same times."""
    there = np.isfinite(computed)
    middle = float(np.mean(computed[there])) if there.any() else 0.0
    center = float(np.mean(tamed)) if tamed.size else 0.0
    first, second = computed[there] - middle, tamed[there] - center
    return Moments(
        samples=np.array(max(float(there.sum()), 1.0)),
        computed=np.array(first.sum()),
        measured=np.array(second.sum()),
        computed2=np.array(first @ first),
        measured2=np.array(second @ second),
        product=np.array(first @ second),
        apart=center - middle,
        measured_variance=float(np.var(tamed)),
    )


@np.errstate(divide="ignore", invalid="ignore", over="ignore")
def unlikeness(moments: Moments, exact: float, scale: FloatArray | float | None = None) -> FloatArray:
    """Return the log of the unexplained share, with the penalty for a line; 0 if nothing is explained.

    Args:
        moments: sums of both signals.
        exact: smallest share that counts.
        scale: sum of squares to which errors are relative; that of the computed values if None.
    """
    computed, measured, product = moments.spreads()
    moving = (measured > FLAT_VARIANCE_SHARE * moments.samples * moments.measured_variance) & (computed > 0)
    along = np.where(moving, product, 0.0) ** 2 / np.where(moving, computed * measured, 1.0)
    freedom = (moments.samples - 1) / np.maximum(moments.samples - 3, 0.5)
    line = np.log(np.clip((1 - along) * freedom, 0, 1) + exact) + np.where(
        product < 0, 2 * LINE_PENALTY, LINE_PENALTY
    )
    errors = moments.squared_error() / (computed if scale is None else scale)
    equal = np.log(np.clip(np.nan_to_num(errors, nan=1.0, posinf=1.0), 0, 1) + exact)
    return np.asarray(np.minimum(0.0, np.minimum(equal, line)))


def exactness(tamed: FloatArray) -> float:
    """Return the share of the variance of measured values that is noise, at least `MIN_UNEXPLAINED_SHARE`."""
    variance = float(np.var(tamed))
    return (
        min(MAX_NOISE_SHARE, max(MIN_UNEXPLAINED_SHARE, noise(tamed) / variance))
        if variance > 0
        else MIN_UNEXPLAINED_SHARE
    )
