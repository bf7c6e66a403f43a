"""Pairs of a computed signal and its measured values: whether either moves, and how unlike both are.

Measured values may equal computed ones, or be a straight line of them: wrong offsets, units and gains make
one, and a sensor mounted the other way round a falling one. A line fits many a piece of a smooth motion, so
it has to explain ten times more than equality does, and a falling one ten times more than a rising one. The
logarithm of what stays unexplained bounds what a single column can say, so that a minority of wrong columns
does not decide.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray

FEWEST_SAMPLES = 4
"""Samples by which two signals can be compared."""

ROUNDING = 1e-8
"""Share of the largest value of a variable, over all joints, below which changes are rounding. Torques of
joints at rest change by 1e-16 to 1e-12 of it, and 1e-8 of a motion is below the resolution of any sensor."""

WIDEST = 3.0
"""Range of values in the search, in ranges of nearly all samples: single wild samples count no more than
their neighbors."""

LARGEST = 1e100
"""Values beyond are no measurements; the search sees the bound, since their squares would overflow."""

ENOUGH = 20_000
"""Samples that tell where about the shift is, and which columns are exchanged."""

NEARLY_ALL = (0.02, 0.98)
"""Quantiles between which nearly all samples lie."""

NORMAL_MEDIAN = 0.6745
"""Median of the size of normal values, in standard deviations."""


class Computed(NamedTuple):
    """A computed signal.

    Attributes:
        at: values at times from the beginning of the result, NaN outside it and next to samples without a
            value.
        slope: derivatives at such times.
        error: root mean square error of interpolation.
        spread: root mean square deviation from the mean.
        moves: whether it does, beyond rounding.
    """

    at: Callable[[FloatArray], FloatArray]
    slope: Callable[[FloatArray], FloatArray]
    error: float
    spread: float
    moves: bool


class Pairing(NamedTuple):
    """A computed signal and its measurement.

    Attributes:
        computed: the signal.
        duration: of the result, s.
        time: of the measured values, s, ascending.
        measured: (samples,).
    """

    computed: Computed
    duration: float
    time: FloatArray
    measured: FloatArray

    def thinned(self) -> Pairing:
        """Return the same with at most `ENOUGH` samples."""
        every = -(-len(self.time) // ENOUGH)
        return self._replace(time=self.time[::every], measured=self.measured[::every])

    def overlap(self, shift: float) -> tuple[FloatArray, BoolArray]:
        """Computed values at the measured times if the result begins at `shift`, and where there are any."""
        computed = self.computed.at(self.time - shift)
        return computed, np.isfinite(computed)


def tame(values: FloatArray) -> FloatArray:
    """Measured values, wild ones moved to the bounds suggested by the others."""
    limited = np.clip(values, -LARGEST, LARGEST)
    low, high = np.quantile(limited, NEARLY_ALL)
    room = WIDEST * (high - low)
    return limited if room == 0 else np.clip(limited, low - room, high + room)


def noise(values: FloatArray) -> float:
    """Variance of the white noise of tame values, from their second differences."""
    second = np.abs(np.diff(values, 2))
    return float(np.median(second) / NORMAL_MEDIAN) ** 2 / 6 if second.size else 0.0


def interpolated(time: FloatArray, values: FloatArray, largest: float) -> Computed:
    """Return a stored signal as a function of the time from its beginning.

    Args:
        time: of the samples, (samples,), s, the first at 0.
        values: (samples,), NaN where there is none.
        largest: value of the variable in size, over all joints.
    """
    from scipy.interpolate import make_interp_spline

    known = np.isfinite(values)
    if np.count_nonzero(known) < FEWEST_SAMPLES:
        return Computed(_nowhere, _nowhere, 0.0, 0.0, moves=False)
    stamps, given = time[known], values[known]
    spline = make_interp_spline(stamps, given, k=3)
    slope, gaps = spline.derivative(), np.where(known, 0.0, np.nan)

    def at(times: FloatArray) -> FloatArray:
        return np.asarray(spline(times) + np.interp(times, time, gaps, left=np.nan, right=np.nan))

    return Computed(
        at=at,
        slope=lambda times: np.asarray(slope(times)),
        error=_interpolation_error(stamps, given),
        spread=float(np.std(given)),
        moves=float(np.ptp(given)) > ROUNDING * largest,
    )


def _nowhere(times: FloatArray) -> FloatArray:
    return np.full(np.shape(times), np.nan)


def _interpolation_error(time: FloatArray, values: FloatArray) -> float:
    """Root mean square error of a cubic spline: that of every second sample, which is 16 times larger."""
    from scipy.interpolate import make_interp_spline

    rounding = float(np.finfo(float).eps * np.abs(values).max())
    if len(time) < 2 * FEWEST_SAMPLES:
        return rounding
    between = slice(1, len(time) - 1, 2)
    coarse = make_interp_spline(time[::2], values[::2], k=3)
    inside = time[between] <= time[::2][-1]
    apart = coarse(time[between][inside]) - values[between][inside]
    return rounding + float(np.sqrt(np.mean(apart**2))) / 16


PRICE = math.log(10.0)
"""Price of a line, and once more of a falling one, in logarithms of the unexplained part."""

EXACT = 1e-5
"""Share of the variance below which nothing counts as unexplained: the filter of a sensor may do that."""

FLAT = 1e-9
"""Share of the variance of a recording below which sums of transforms are only rounding."""

NOISIEST = 0.1
"""Largest such share. Where samples are few, motion looks like noise."""


class Moments(NamedTuple):
    """Sums over the samples that computed and measured values have in common; arrays for many shifts.

    Attributes:
        samples: how many.
        computed, measured: sums of the values, each less a constant.
        computed2, measured2, product: sums of their squares and products.
        apart: constant of the measured values less that of the computed ones.
        measured_variance: of all measured values.
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
        """Sums of squares of both about their means, and of their products."""
        return (
            self.computed2 - self.computed**2 / self.samples,
            self.measured2 - self.measured**2 / self.samples,
            self.product - self.computed * self.measured / self.samples,
        )

    def squared_error(self) -> FloatArray:
        """Sum of squares of measured minus computed values."""
        errors = self.computed2 - 2 * self.product + self.measured2
        return errors + 2 * self.apart * (self.measured - self.computed) + self.samples * self.apart**2


def moments_of(computed: FloatArray, tamed: FloatArray) -> Moments:
    """Sums of computed values, NaN where there are none, and of measured ones at the same times."""
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
    """Logarithm of the unexplained share, with the price of a line; 0 where nothing is explained.

    Args:
        moments: of both signals.
        exact: share below which nothing counts as unexplained.
        scale: sum of squares of which errors are shares; of the computed values if None.
    """
    computed, measured, product = moments.spreads()
    moving = (measured > FLAT * moments.samples * moments.measured_variance) & (computed > 0)
    along = np.where(moving, product, 0.0) ** 2 / np.where(moving, computed * measured, 1.0)
    freedom = (moments.samples - 1) / np.maximum(moments.samples - 3, 0.5)
    line = np.log(np.clip((1 - along) * freedom, 0, 1) + exact) + np.where(product < 0, 2 * PRICE, PRICE)
    errors = moments.squared_error() / (computed if scale is None else scale)
    equal = np.log(np.clip(np.nan_to_num(errors, nan=1.0, posinf=1.0), 0, 1) + exact)
    return np.asarray(np.minimum(0.0, np.minimum(equal, line)))


def exactness(tamed: FloatArray) -> float:
    """Share of the variance of measured values that their noise leaves unexplained, `EXACT` at least."""
    variance = float(np.var(tamed))
    return min(NOISIEST, max(EXACT, noise(tamed) / variance)) if variance > 0 else EXACT
