"""Penalized splines of one resolution, their likelihood, and the power of the motion below their cut-off.

A `Model` has a penalty for each difference of coefficients, constant in segments, i.e. a Gaussian prior whose
variance is the inverse penalty. Its posterior gives spline and variances.

A motion whose highest derivative is determined has many times the power of the noise at its fastest parts,
and falls below the noise within an octave. Where nothing does so in any octave of any stretch, a search
through finer resolutions finds nothing, and would take most of the time of a fit: `enough_spans`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.trajectory.fits.bins import Bins, Whitened, uniform_basis
from vsacli.trajectory.fits.least_squares import BLOCK, BandedFactor, Posterior, factorize, sort_rows

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


CORRELATIONS = (0.0, 0.3, 0.6, 0.8, 0.9, 0.95, 0.98, 1.0)
"""Correlations of neighboring samples of the noise that are tried. The filter that removes one keeps the
ratio of motion to noise at each frequency, and is too flat to remove a motion: a factor of 4 in an octave."""

FEWEST = 2048
"""Fewest samples for which a search takes long enough to be ended early."""

FEWEST_MEANS = 32
"""Fewest means of an octave: with these, differences pass from 8 periods in the recording on."""

DIFFERENCES = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / np.sqrt(70)
"""Weights of differences of fourth order, which keep the deviation of white noise. They pass the octave below
the highest frequency of means."""

WINDOW = 64
"""Number of differences in a stretch, some 25 of them independent: one of noise rarely has twice the mean
power. A motion from rest to rest, with 6 coefficients determined to a quarter, has thrice."""

EQUAL = 1.4
"""Largest ratio of the power of white noise in an octave to that in finer ones, by medians over stretches; of
a few stretches it may be as large as 1 + 1/sqrt(stretches)."""

LARGEST = 2.5
"""Largest ratio of the power of white noise in a stretch to the median of all finer octaves."""

EVEN = 4.0
"""Largest interval between samples, in usual ones, at which octaves of samples are octaves of time."""

SPANS_PER_MEAN = 16
"""Spans with which a search ends, for each mean of the coarsest octave that is noise alone. A quarter
resolves the motion, and the next resolution has to confirm it; but where the noise was not understood before,
a motion is accepted up to four times later."""


def enough_spans(time: FloatArray, row: FloatArray) -> float:
    """Return the number of spans after which finer ones show nothing new; infinite if that is uncertain.

    Args:
        time: times, (samples,), s.
        row: values, (samples,).
    """
    steps = np.diff(time)
    if len(row) < FEWEST or steps.max() > EVEN * float(np.median(steps)):
        return np.inf
    whitened = (row[1:] - correlation * row[:-1] for correlation in CORRELATIONS)
    return SPANS_PER_MEAN * min(map(_means_of_motion, whitened))


def _means_of_motion(values: FloatArray) -> float:
    """Return the number of means in the finest octave with more than white noise.

    In the first octave, beyond the fastest motion that splines resolve, only stretches of noise may differ,
    as where an encoder flickers. It is infinite if nothing is certain.
    """
    means, count = values, np.inf
    finer_medians: list[float] = []
    while len(means) >= FEWEST_MEANS:
        powers = _powers(means)
        median_power = float(np.median(powers))
        floor = float(np.median(finer_medians)) if finer_medians else median_power
        max_ratio = max(EQUAL, 1 + 1 / np.sqrt(len(powers)))
        is_equal = floor / max_ratio <= median_power <= max_ratio * floor
        if not (floor and is_equal and (not finer_medians or powers.max() <= LARGEST * floor)):
            return count
        finer_medians.append(median_power)
        count = len(means) / 2
        means = means[: len(means) // 2 * 2].reshape(-1, 2).sum(axis=1) / np.sqrt(2)
    return count


def _powers(means: FloatArray) -> FloatArray:
    """Return the mean square of the differences of means in each stretch, (stretches,)."""
    squares = np.convolve(means, DIFFERENCES, "valid") ** 2
    stretches = np.array_split(squares, max(1, len(squares) // WINDOW))
    return np.array([stretch.mean() for stretch in stretches])


LEAST_PENALTY, LARGEST_PENALTY = 1e-8, 1e22

LARGEST_STEP = 2.3
"""Largest step of the logarithm of a penalty: a decade.

Without a limit the updates diverged on filtered noise.
"""

KINK = 1e3
"""Ratio of penalties of neighboring segments above which motion starts or stops there. In a sweep the ratio
is about 20, at the ends of pauses 10^9."""

ENDS = 0.05
"""Share of the recording at each end that is ignored in deviations and comparisons."""


@dataclass(frozen=True, eq=False)
class Model:
    """The model of a recording at one resolution.

    Attributes:
        bins: means of the recording.
        whitened: these means with independent errors, for a correlation of the noise of neighboring means.
        penalties: penalty of each difference of coefficients, relative to 1/variance of the noise.
        segments: number of segments in which penalties are constant.
    """

    bins: Bins
    whitened: Whitened
    penalties: FloatArray
    segments: int

    @property
    def _segment(self) -> IndexArray:
        return segment_of(len(self.penalties), self.segments)

    @property
    def each_penalty(self) -> FloatArray:
        """Penalties of the segments, (segments,)."""
        return self.penalties[np.searchsorted(self._segment, np.arange(self.segments))]

    @cached_property
    def _factor(self) -> BandedFactor:
        return _factor(self.bins, self.whitened, self.penalties)

    @cached_property
    def deviance(self) -> float:
        """Minus twice the logarithm of the restricted likelihood, without its constant."""
        return deviance([evidence(self.bins, self.whitened, self.penalties, self._factor)])

    @cached_property
    def noise_variance(self) -> float:
        """Variance of a whitened mean: known, or else of maximum likelihood."""
        known_variance = self.whitened.variance
        return (
            self._factor.rest / _degrees_of_freedom(self.bins) if known_variance is None else known_variance
        )

    @cached_property
    def posterior(self) -> Posterior:
        """Posterior of the coefficients, with variances in units of the noise variance."""
        return Posterior(self._factor.diagonal, self._factor.upper)

    @cached_property
    def coefficients(self) -> FloatArray:
        """Coefficients of the spline."""
        return self.posterior.unknowns(self._factor.right)[: self.bins.coefficients]

    @property
    def spline(self) -> BSpline[np.float64]:
        """Most probable spline, with one column."""
        return scipy.interpolate.BSpline(self.bins.knots, self.coefficients[:, None], self.bins.degree)

    @cached_property
    def freedoms(self) -> FloatArray:
        """Degree of freedom of each difference of coefficients: 1 by the samples, 0 by the prior alone."""
        prior_variances = self.posterior.variances(self.bins.differences).ravel()[: len(self.penalties)]
        return np.clip(1 - prior_variances * self.penalties, 0, 1)

    @property
    def piece(self) -> float:
        """Mean length, s, for which the samples determine one coefficient: a knot span, or longer."""
        bins = self.bins
        return bins.span * bins.spans / (bins.degree + float(np.sum(self.freedoms)))

    def updated(self, step: float) -> Model:
        """Return the model with penalties updated by its spline.

        Args:
            step: share of the full logarithmic step.
        """
        segment = self._segment
        freedoms = np.maximum(np.bincount(segment, self.freedoms), 1e-4 * np.bincount(segment))
        squared_differences = np.bincount(
            segment, self.penalties * np.diff(self.coefficients, self.bins.degree) ** 2
        )
        log_change = np.log(
            freedoms * self.noise_variance / np.maximum(squared_differences, np.finfo(float).tiny)
        )
        log_change = step * np.clip(log_change, -LARGEST_STEP, LARGEST_STEP)
        penalties = np.clip(self.penalties * np.exp(log_change[segment]), LEAST_PENALTY, LARGEST_PENALTY)
        return Model(self.bins, self.whitened, penalties, self.segments)

    @cached_property
    def cautious(self) -> Posterior:
        """Posterior of the coefficients if the ends of segments are uncertain by a segment.

        Each difference has the smallest penalty of its own and the neighboring segments. Most of the error
        comes from ends of pauses that lie within a segment.
        """
        if self.segments == 1:
            return self.posterior
        padded_penalties = np.pad(self.each_penalty, 1, constant_values=np.inf)
        min_penalties = np.minimum(
            np.minimum(padded_penalties[:-2], padded_penalties[1:-1]), padded_penalties[2:]
        )
        factor = _factor(self.bins, self.whitened, min_penalties[self._segment])
        return Posterior(factor.diagonal, factor.upper)

    def stiffened(self, logarithm: float) -> Model:
        """Return the model with all penalties multiplied by the exponential of a number."""
        return Model(self.bins, self.whitened, self.penalties * np.exp(logarithm), self.segments)

    def variances(self, order: int, posterior: Posterior | None = None) -> FloatArray:
        """Return the variances of a derivative in the middle of both bins of each span, (2 spans,).

        Args:
            order: order of the derivative.
            posterior: posterior of the coefficients; None for that of the model.
        """
        places = np.array([0.25, 0.75])
        rows = _derivative_rows(places, self.bins.degree, order) / self.bins.span**order
        # All spans of a block have the same B-splines, shifted by one from span to span.
        block = sort_rows(np.repeat(np.arange(BLOCK), 2), np.tile(rows, (BLOCK, 1)), BLOCK).blocks
        variances = (posterior or self.posterior).variances(block)
        return variances.ravel()[: 2 * self.bins.spans]

    @property
    def kinks(self) -> BoolArray:
        """Mask of `probes` in segments with a penalty far from that of a neighbor."""
        is_far = np.abs(np.diff(np.log(self.each_penalty))) > np.log(KINK)
        segments: BoolArray = np.append(is_far, False) | np.append(False, is_far)
        return segments[segment_of(2 * self.bins.spans, self.segments)]

    @property
    def probes(self) -> FloatArray:
        """Times of `variances`, s."""
        bins = self.bins
        return np.asarray(bins.start + bins.span / 2 * (np.arange(2 * bins.spans) + 0.5))

    @property
    def inside(self) -> BoolArray:
        """Mask of `probes` away from the ends."""
        share = np.linspace(0, 1, 2 * self.bins.spans)
        return (share > ENDS) & (share < 1 - ENDS)


def segment_of(count: int, segments: int) -> IndexArray:
    """Return the index of the segment of each of `count` differences, (count,)."""
    return (np.arange(count) * segments) // count


class Evidence(NamedTuple):
    """The terms of the restricted likelihood for a recording or a stretch of it.

    Attributes:
        residual_squares: residual sum of squares, penalties included.
        log_determinant: logarithm of the determinants.
        degrees_of_freedom: number of means minus that of coefficients of the polynomial without penalty.
        variance: variance of a whitened mean; None if unknown.
    """

    residual_squares: float
    log_determinant: float
    degrees_of_freedom: int
    variance: float | None


def evidence(
    bins: Bins, whitened: Whitened, penalties: FloatArray, factor: BandedFactor | None = None
) -> Evidence:
    """Return the evidence for penalties, (differences,)."""
    factor = factor or _factor(bins, whitened, penalties)
    log_determinant = factor.log_determinant - float(np.sum(np.log(penalties))) - whitened.log_scale
    return Evidence(factor.rest, log_determinant, _degrees_of_freedom(bins), whitened.variance)


def deviance(segments: Sequence[Evidence]) -> float:
    """Return minus twice the log restricted likelihood of all segments together."""
    residual_squares = sum(segment.residual_squares for segment in segments)
    degrees_of_freedom, variance = (
        sum(segment.degrees_of_freedom for segment in segments),
        segments[0].variance,
    )
    if variance is None:
        deviance_value = degrees_of_freedom * math.log(
            max(residual_squares, np.finfo(float).tiny) / degrees_of_freedom
        )
    else:
        deviance_value = degrees_of_freedom * (math.log(variance) - 1) + residual_squares / variance
    return deviance_value + sum(segment.log_determinant for segment in segments)


def _factor(bins: Bins, whitened: Whitened, penalties: FloatArray) -> BandedFactor:
    differences, sample_factor = bins.differences, whitened.factor
    weights = np.ones(differences.shape[:2])
    weights.ravel()[: len(penalties)] = np.sqrt(penalties)
    rows = np.concatenate([weights[..., None] * differences, sample_factor.rows], axis=1)
    factor = factorize(rows, np.concatenate([np.zeros_like(weights), sample_factor.right], axis=1))
    return factor._replace(rest=factor.rest + sample_factor.rest)


def _degrees_of_freedom(bins: Bins) -> int:
    return len(bins.means) - bins.degree


def _derivative_rows(places: FloatArray, degree: int, order: int) -> FloatArray:
    """Return a derivative of the B-splines of a span, for knots at distance 1, (places, degree + 1)."""
    lower = np.stack(uniform_basis(places, degree - order), axis=1)
    for _ in range(order):
        lower = -np.diff(lower, prepend=0, append=0, axis=1)
    return np.asarray(lower)


STEP = 2.4
"""Step of log t from one spline to the next: a sixth in frequency with differences of order seven."""


BANDS = 4
"""Number of bands in which a spectrum is evaluated, down to half of the cut-off frequency."""

FALLING = 25.0
"""Ratio of the power in the lowest band to that in the highest above which a spectrum falls towards the
cut-off. With jumps of jerk the spectrum of d4q is flat: on 180 recordings the ratio was 0.2 to 20. For steps
of velocity within 200 ms it was 17 to 120, unless noise hid their smoothness."""


class MotionPower(NamedTuple):
    """Power of a derivative of the motion between neighboring cut-offs, highest first.

    Attributes:
        found: squared difference of splines minus the part due to noise, in units of its variance, (bands,).
        expected: power expected by the prior, in the same units, (bands,).
    """

    found: FloatArray
    expected: FloatArray


def motion_power(model: Model, order: int, bands: int, weight: FloatArray) -> MotionPower:
    """Return the power of a derivative below the cut-off of a spline.

    With the gain H = 1/(1 + t g) of a spline at a frequency and noise of density N the posterior variance is
    v = int N H, and int N H^2 = v + dv/dlog t. The prior expects motion of the density N / g at t = 1.
    Products of gains are differences: H1 H2 (t1 - t2) = t1 H1 - t2 H2.

    Args:
        model: model of the spline, t = 1.
        order: order of the derivative.
        bands: number of bands.
        weight: weights of `Model.probes`.
    """
    logarithms = STEP * np.arange(bands + 1)
    splines = [model.stiffened(each) for each in logarithms.tolist()]
    variance = np.array([weight @ each.variances(order) for each in splines])
    squared = variance * (1 + np.gradient(np.log(variance), STEP, edge_order=2))
    rows = np.array([each.spline(model.probes, nu=order)[:, 0] for each in splines])
    found = np.diff(rows, axis=0) ** 2 @ weight / model.noise_variance
    less, more = np.exp(logarithms[:-1]), np.exp(logarithms[1:])
    both = (more * variance[1:] - less * variance[:-1]) / (more - less)
    noise = squared[:-1] + squared[1:] - 2 * both
    expected = more * (both - squared[1:]) - less * (squared[:-1] - both)
    return MotionPower(found - noise, expected)


def falls(model: Model, order: int) -> bool:
    """Return whether the spectrum of a derivative falls towards the cut-off, unlike that of impulses."""
    lowest_last = motion_power(model, order, BANDS, model.inside / np.sum(model.inside)).found
    return bool(lowest_last[-1] > FALLING * max(lowest_last[0], 0.0))
