"""Penalised splines of one resolution whose penalty and correlation of noise have the largest likelihood.

The spline's coefficients have a prior: their differences of the order of the degree are independent, with
variances that are constant on segments of the record. Pauses get a small one, fast parts a large one. Noise
is a process of first order. Its correlation and the variances maximise the restricted likelihood (Patterson &
Thompson, 1971), the variances by the fixed point of Fellner (1986) and Schall (1991) with step control.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.trajectory.fits.bins import Bins, Whitened, uniform_basis
from vsacli.trajectory.fits.information import BLOCK, Factor, Posterior, factorise, sort_rows

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

CORRELATIONS = np.array([-0.5, -0.25, 0.0, 0.2, 0.4, 0.55, 0.7, 0.8, 0.87, 0.92, 0.95, 0.98])
"""Of the noise of neighbouring means, tried at first."""

SMALL_CORRELATIONS = np.array([0.01, 0.03, 0.1])
"""Tried, too, if the noise of samples is known: that of means then depends on them."""

FINER_CORRELATIONS = np.array([-0.3, -0.1, 0.0, 0.1, 0.3])
"""Added to the inverse hyperbolic tangent of the best, twice."""

FIRST_DECADES = np.arange(-6.0, 19.0)
"""Penalties tried at the coarsest resolution, as powers of ten: from none to a polynomial."""

NEAR_DECADES = np.arange(-5.0, 5.0)
"""Penalties tried around what the coarser resolution found."""

LEAST_PENALTY, LARGEST_PENALTY = 1e-8, 1e22

NEAR_CORRELATION = 1.2
"""Distance of inverse hyperbolic tangents within which correlations are tried around it."""

MOST_SEGMENTS = 64
FEWEST_DIFFERENCES = 4
"""In a segment."""

LARGEST_STEP = 2.3
"""Of the logarithm of a penalty: a decade. Without a limit the updates ran away on filtered noise."""

UPDATES = 30
LEAST_GAIN = 0.05
"""Of twice the logarithm of the likelihood by which an update must improve to be followed by another."""

ENDS = 0.05
"""Share of the record at each end that does not count for deviations and comparisons."""


@dataclass(frozen=True, eq=False)
class Model:
    """What is assumed of a record at one resolution.

    Attributes:
        bins: of the record.
        correlation: of the noise of neighbouring means.
        penalties: of each difference of coefficients, relative to 1/variance of the noise.
        segments: in which they are constant.
    """

    bins: Bins
    correlation: float
    penalties: FloatArray
    segments: int

    @cached_property
    def whitened(self) -> Whitened:
        """The means, with independent errors."""
        return self.bins.whitened(self.correlation)

    @cached_property
    def _factor(self) -> Factor:
        return _factors(self.bins, self.whitened, self.penalties[None])

    @cached_property
    def deviance(self) -> float:
        """Minus twice the logarithm of the restricted likelihood, without its constant."""
        return float(_deviances(self.bins, self.whitened, self.penalties[None], self._factor)[0])

    @cached_property
    def noise_variance(self) -> float:
        """Of a whitened mean: as it is known of the record, or else what maximises the likelihood."""
        known = self.whitened.variance
        return float(self._factor.rest[0]) / _freedom(self.bins) if known is None else known

    @cached_property
    def posterior(self) -> Posterior:
        """Of the coefficients; its unit of variance is that of the noise."""
        return Posterior(self._factor.diagonal[0], self._factor.upper[0])

    @cached_property
    def coefficients(self) -> FloatArray:
        """Of the spline."""
        return self.posterior.unknowns(self._factor.right[0])[: self.bins.coefficients]

    @property
    def spline(self) -> BSpline[np.float64]:
        """The most probable one, with one column."""
        from scipy.interpolate import BSpline

        return BSpline(self.bins.knots, self.coefficients[:, None], self.bins.degree)

    def updated(self, step: float) -> Model:
        """With the penalties that the found spline suggests.

        Args:
            step: share of the logarithmic step that is taken.
        """
        order, count = self.bins.degree, len(self.penalties)
        segment = _segment(count, self.segments)
        certain = self.posterior.variances(self.bins.differences(order)).ravel()[:count] * self.penalties
        size = np.bincount(segment)
        free = np.maximum(np.bincount(segment, np.clip(1 - certain, 0, 1)), 1e-4 * size)
        found = np.bincount(segment, self.penalties * np.diff(self.coefficients, order) ** 2)
        change = np.log(free * self.noise_variance / np.maximum(found, np.finfo(float).tiny))
        change = step * np.clip(change, -LARGEST_STEP, LARGEST_STEP)
        penalties = np.clip(self.penalties * np.exp(change[segment]), LEAST_PENALTY, LARGEST_PENALTY)
        return Model(self.bins, self.correlation, penalties, self.segments)

    @cached_property
    def cautious(self) -> Posterior:
        """Of the coefficients, where the ends of segments are uncertain by a segment.

        Each difference has the smallest penalty of its own and the neighbouring segments. Most of the error
        comes from ends of pauses that lie within a segment.
        """
        if self.segments == 1:
            return self.posterior
        segment = _segment(len(self.penalties), self.segments)
        each = np.full(self.segments + 2, np.inf)
        each[1 + segment] = self.penalties
        least = np.minimum(np.minimum(each[:-2], each[1:-1]), each[2:])
        factor = _factors(self.bins, self.whitened, least[segment][None])
        return Posterior(factor.diagonal[0], factor.upper[0])

    def deviations(self, order: int) -> FloatArray:
        """Standard deviation of a derivative in the middle of both bins of each span, (2 spans,)."""
        bins = self.bins
        places = np.array([0.25, 0.75])
        rows = _derivative_rows(places, bins.degree, order) / bins.span**order
        first = np.repeat(np.arange(bins.spans), len(places))
        ordered = sort_rows(first, np.tile(rows, (bins.spans, 1)), bins.coefficients)
        variances = self.cautious.variances(ordered.blocks)[ordered.block, ordered.place]
        return np.asarray(np.sqrt(variances * self.noise_variance))

    @property
    def probes(self) -> FloatArray:
        """The times of `deviations`, s."""
        bins = self.bins
        return np.asarray(bins.start + bins.span / 2 * (np.arange(2 * bins.spans) + 0.5))

    @property
    def inside(self) -> BoolArray:
        """Which of them are away from the ends."""
        share = np.linspace(0, 1, 2 * self.bins.spans)
        inside: BoolArray = (share > ENDS) & (share < 1 - ENDS)
        return inside


def most_likely(bins: Bins, coarser: Model | None) -> Model:
    """The model of the largest restricted likelihood that the search finds.

    Args:
        bins: of the record.
        coarser: what was found with half as many spans, around which to search; None: everywhere.
    """
    model = _improved(_best_of_grid(bins, coarser))
    model = _segmented(model)
    for _ in range(2):
        model = _improved(_recorrelated(model))
    return model


def _best_of_grid(bins: Bins, coarser: Model | None) -> Model:
    """One penalty throughout."""
    count = bins.coefficients - bins.degree
    tried = CORRELATIONS if bins.noise is None else np.append(CORRELATIONS, SMALL_CORRELATIONS)
    grids = [(tried, FIRST_DECADES)]
    if coarser is not None:
        # differences of order n of a given function shrink by 2^n, noise of a mean by 2^(-1/2)
        centre = np.mean(np.log10(coarser.penalties)) + (2 * bins.degree - 1) * np.log10(2)
        near = np.abs(np.arctanh(tried) - np.arctanh(coarser.correlation)) <= NEAR_CORRELATION
        # what passed for noise on coarser bins, as a sweep does, may be resolved now: look everywhere too
        grids = [(tried[near], centre + NEAR_DECADES), (CORRELATIONS[::3], FIRST_DECADES[::3])]
    best = np.inf, 0.0, np.ones(count)
    for correlations, decades in grids:
        penalties = np.repeat(10.0 ** decades[:, None], count, axis=1)
        for correlation in correlations.tolist():
            deviances = _deviances(bins, bins.whitened(correlation), penalties)
            i = int(np.argmin(deviances))
            if deviances[i] < best[0]:
                best = deviances[i], correlation, penalties[i]
    return Model(bins, best[1], best[2], 1)


def _improved(model: Model) -> Model:
    """After updates of its penalties, each accepted if it makes the data more likely."""
    step = 1.0
    for _ in range(UPDATES):
        candidate = model.updated(step)
        gain = model.deviance - candidate.deviance
        if gain > 0:
            model, step = candidate, min(1.0, 1.5 * step)
            if gain < LEAST_GAIN:
                break
        else:
            step *= 0.4
            if step < 0.05:
                break
    return model


def _segmented(model: Model) -> Model:
    """With twice as many segments as long as the likelihood gains, if need be after doubling twice.

    Each additional segment must gain more than its own parameter can by chance.
    """
    most = min(MOST_SEGMENTS, len(model.penalties) // FEWEST_DIFFERENCES)
    trial = model
    while 2 * trial.segments <= most and trial.segments <= 2 * model.segments:
        trial = _improved(Model(model.bins, model.correlation, trial.penalties, 2 * trial.segments))
        if trial.deviance < model.deviance - (trial.segments - model.segments) - 1:
            model = trial
    return model


def _recorrelated(model: Model) -> Model:
    """With the most likely correlation of the noise near its own."""
    centre = np.arctanh(model.correlation)
    candidates = np.clip(np.tanh(centre + FINER_CORRELATIONS), -0.6, 0.985)
    models = [Model(model.bins, each, model.penalties, model.segments) for each in candidates.tolist()]
    return min(models, key=lambda each: each.deviance)


def _factors(bins: Bins, whitened: Whitened, penalties: FloatArray) -> Factor:
    differences = bins.differences(bins.degree)
    weights = np.ones((len(penalties), len(differences) * BLOCK))
    weights[:, : penalties.shape[1]] = np.sqrt(penalties)
    shaped = weights.reshape(len(penalties), -1, BLOCK)
    return factorise(whitened.rows, whitened.target, differences, shaped)


def _deviances(
    bins: Bins, whitened: Whitened, penalties: FloatArray, factor: Factor | None = None
) -> FloatArray:
    """Minus twice the logarithms of the restricted likelihoods, (candidates,)."""
    factor = factor or _factors(bins, whitened, penalties)
    freedom, known = _freedom(bins), whitened.variance
    if known is None:
        size = freedom * np.log(np.maximum(factor.rest, np.finfo(float).tiny) / freedom)
    else:
        size = freedom * (np.log(known) - 1) + factor.rest / known
    volume = factor.log_determinants - np.sum(np.log(penalties), axis=1) - whitened.log_scale
    return np.asarray(size + volume)


def _freedom(bins: Bins) -> int:
    """Means less the coefficients of the polynomial that costs no penalty."""
    return len(bins.means) - bins.degree


def _segment(count: int, segments: int) -> IndexArray:
    return (np.arange(count) * segments) // count


def _derivative_rows(places: FloatArray, degree: int, order: int) -> FloatArray:
    """A derivative of the B-splines of a span whose knots are one apart, (places, degree + 1)."""
    lower = np.stack(uniform_basis(places, degree - order), axis=1)
    for _ in range(order):
        lower = -np.diff(lower, prepend=0, append=0, axis=1)
    return np.asarray(lower)
