"""The resolution of a smoothing spline: coarse to fine, until the next one confirms it.

At each resolution the penalties and the correlation of the noise are those that make the record most likely.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.fits.bins import BINS_PER_SPAN, Bins, Moments
from vsacli.trajectory.fits.penalised import Model, deviances, evidence, segment_of

CORRELATIONS = np.array([-0.5, -0.25, 0.0, 0.2, 0.4, 0.55, 0.7, 0.8, 0.87, 0.92, 0.95, 0.98])
"""Correlations of the noise of neighbouring means tried at first."""

SMALL_CORRELATIONS = np.array([0.01, 0.03, 0.1])
"""Tried, too, if the noise of samples is known: that of means then depends on them."""

FINER_CORRELATIONS = np.array([-0.3, -0.1, 0.0, 0.1, 0.3])
"""Added to the inverse hyperbolic tangent of the best, twice."""

FIRST_DECADES = np.arange(-6.0, 19.0)
"""Penalties tried at the coarsest resolution, as powers of ten: from none to a polynomial."""

NEAR_DECADES = np.arange(-5.0, 5.0)
"""Penalties tried around those of the coarser resolution."""

NEAR_CORRELATION = 1.2
"""Distance of inverse hyperbolic tangents within which correlations are tried around it."""

MOST_SPANS_OF_GRID = 2048
"""Spans from which on stretches are tried instead, since only a start is needed: that saves half of the
time."""

STRETCHES = 8

MOST_SEGMENTS = 64
FEWEST_DIFFERENCES = 4
"""Fewest differences in a segment."""

UPDATES = 30
LEAST_GAIN = 0.05
"""Smallest gain of twice the log likelihood by which an update is followed by another."""


def most_likely(bins: Bins, coarser: Model | None) -> Model:
    """Return the model of the largest restricted likelihood that the search finds.

    Args:
        bins: of the record.
        coarser: result with half as many spans, around which to search; None: everywhere.
    """
    model = _segmented(_improved(_best_of_grids(bins, _grids(bins, coarser))))
    for _ in range(1 if _long(bins) else 2):
        model = _improved(_recorrelated(model))
    return model


class _Grid(NamedTuple):
    """Models that are tried together.

    Attributes:
        correlations: of the noise of neighbouring means.
        shape: logarithms of the penalties of segments to the base 10, (segments,).
        decades: added to these.
    """

    correlations: FloatArray
    shape: FloatArray
    decades: FloatArray

    def penalties(self, differences: int) -> FloatArray:
        """Return the penalties of each difference of coefficients, (decades, differences)."""
        each = self.shape[segment_of(differences, len(self.shape))]
        return np.asarray(10.0 ** (each + self.decades[:, None]))


def _grids(bins: Bins, coarser: Model | None) -> list[_Grid]:
    """Return grids with one penalty throughout; for long recordings also with those of the coarser model."""
    tried = CORRELATIONS if bins.noise is None else np.append(CORRELATIONS, SMALL_CORRELATIONS)
    level = np.zeros(1)
    if coarser is None:
        return [_Grid(tried, level, FIRST_DECADES)]
    near = np.abs(np.arctanh(tried) - np.arctanh(coarser.correlation)) <= NEAR_CORRELATION
    found = np.log10(coarser.each_penalty if _long(bins) else coarser.penalties)
    shape = found if _long(bins) else np.mean(found, keepdims=True)
    # differences of order n of a given function shrink by 2^n, noise of a mean by 2^(-1/2)
    growth = (2 * bins.degree - 1) * np.log10(2)
    # what passed for noise on coarser bins, as a sweep does, may be resolved now: look everywhere too
    everywhere = _Grid(CORRELATIONS[::3], level, FIRST_DECADES[::3])
    return [_Grid(tried[near], shape + growth, NEAR_DECADES), everywhere]


def _best_of_grids(bins: Bins, grids: Sequence[_Grid]) -> Model:
    """Return the model of largest likelihood; of long recordings by distant stretches, as a start."""
    differences = bins.coefficients - bins.degree
    spans = MOST_SPANS_OF_GRID // STRETCHES if _long(bins) else bins.spans
    firsts = np.linspace(0, bins.spans - spans, STRETCHES if _long(bins) else 1).astype(int).tolist()
    stretches = [(bins.stretch(first, spans), slice(first, first + spans)) for first in firsts]
    best, least = Model(bins, 0.0, np.ones(differences), 1), np.inf
    for grid in grids:
        penalties = grid.penalties(differences)
        for correlation in grid.correlations.tolist():
            found = deviances(
                [evidence(part, part.whitened(correlation), penalties[:, of]) for part, of in stretches]
            )
            i = int(np.argmin(found))
            if found[i] < least:
                best, least = Model(bins, correlation, penalties[i], len(grid.shape)), found[i]
    return best


def _long(bins: Bins) -> bool:
    return bins.spans > MOST_SPANS_OF_GRID


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
    """Return the model with twice as many segments as long as the likelihood gains.

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
    """Return the model with the most likely correlation of the noise near its own."""
    centre = np.arctanh(model.correlation)
    candidates = np.clip(np.tanh(centre + FINER_CORRELATIONS), -0.6, 0.985)
    models = [Model(model.bins, each, model.penalties, model.segments) for each in candidates.tolist()]
    return min(models, key=lambda each: each.deviance)


FIRST_SPANS, FIRST_SPANS_SHORT = 32, 4
"""Spans of the coarsest resolution; fewer for recordings of fewer than `SHORT` samples."""

SHORT = 256

FEWEST_SAMPLES, ALWAYS_SPANS, MOST_SPANS = 3, 128, 32768
"""Samples of a span; spans that there may be also with fewer, and never more of. Noise of fewer samples in a
row has spoilt what a finer resolution would show, and time grows with the spans."""

NEGLIGIBLE = 0.02
"""Relative change of the highest derivative from one resolution to the next that asks for no finer one. If
noise does not explain it, the next is taken. With a fifth of this, filtered noise was followed in a sweep."""

CONFIRMED = 1.0
"""Deviations by which that derivative may change then. With more, half the knots were accepted of motions
from rest to rest, and the true error was beyond two deviations in up to 30 % of the samples."""

KINK_CAUTION = 5.0
"""Factor of the variance where motion starts or stops when resolutions are compared: errors are up to 2.2
deviations there, root mean square."""

ACCEPTED = 0.25
"""Largest relative deviation of the highest derivative with which a resolution is accepted. Motions whose
fast parts pass for noise had 0.3 and more."""

CLOSE = 3.0
"""Factor above the least residual of all resolutions, up to which one is considered if none is accepted. A
coarse one may state the least deviation of a derivative that it does not see: with a factor of 100, steps of
velocity smoothed over 50 ms were missed by 0.03 rad, and motor torques 17 % off where 7 % were stated."""

MISSED = 0.3
"""Share of the record's deviation that a residual may have. A larger one is motion that no resolution but the
finest follows, which none confirms."""

PROBES = 16384
"""Samples, about, of which a residual is taken."""

SPANS_PER_PERIOD = 4.0
"""Spans per period of the highest frequency of a motion of known bandwidth: of a sine of that frequency
the spline of degree 7 misses less than 1 % of the fourth derivative."""


class KnownNoise(NamedTuple):
    """Noise and bandwidth of a component as given by the user.

    Attributes:
        deviation: standard deviation of a sample's noise; None: it is estimated.
        bandwidth: above which there is no motion, Hz; None: the record tells.
    """

    deviation: float | None = None
    bandwidth: float | None = None


class Resolution(NamedTuple):
    """A resolution, compared with the next.

    Attributes:
        model: the coarser of both, or the finer if noise does not explain the change.
        deviation: of the highest derivative by noise, relative.
        change: of that derivative from one to the other, relative.
        unexplained: what of the change noise does not explain, in units of the row per s^order.
        residual: of the model, root mean square.
        given: whether it follows from a bandwidth.
    """

    model: Model
    deviation: float
    change: float
    unexplained: float
    residual: float
    given: bool = False

    @property
    def total(self) -> float:
        """Both together, as an unresolved part is an error like any other."""
        return float(np.hypot(self.deviation, self.change))

    @property
    def accepted(self) -> bool:
        """Whether the next resolution changes no more than noise does, and both are small."""
        confirmed = self.change < max(CONFIRMED * self.deviation, NEGLIGIBLE)
        return self.given or (confirmed and self.total < ACCEPTED)


def find_resolution(
    time: FloatArray,
    row: FloatArray,
    degree: int,
    order: int,
    known: KnownNoise,
    below: float = np.inf,
) -> Resolution | None:
    """Return the first resolution that the next one confirms, or that of a given bandwidth.

    Coarse to fine, since it is the band that counts: above the frequency at which the motion falls below the
    noise, whatever colour this has does not matter, and only a resolution beyond it would have to know it.

    Args:
        time: (samples,), s.
        row: (samples,), of mean 0 and deviation 1.
        degree: of the spline.
        order: of the highest derivative that is needed.
        known: given noise and bandwidth, the deviation in units of the row.
        below: a frequency in Hz that no resolution that is tried may follow.

    Returns:
        If none is confirmed, that with the least deviation among those close to the samples; the finest if
        none is; None if there is none.
    """
    if known.bandwidth is not None:
        return _given(time, row, degree, order, known)
    tried = []
    finest: Model | None = None
    for coarse, finest in pairwise(_models(_moments(time, row, degree, below), known)):
        tried.append(_compared(time, row, coarse, finest, order))
        if tried[-1].accepted:
            return tried[-1]
    least = min((each.residual for each in tried), default=0.0)
    if finest is not None and least > MISSED:
        return tried[-1]._replace(model=finest, residual=_residual(time, row, finest))
    close = [each for each in tried if each.residual <= CLOSE * least]
    return min(close, key=lambda each: each.total, default=None)


def _given(
    time: FloatArray, row: FloatArray, degree: int, order: int, known: KnownNoise
) -> Resolution | None:
    assert known.bandwidth is not None
    spans = SPANS_PER_PERIOD * known.bandwidth * float(time[-1] - time[0])
    finest = int(np.clip(np.ceil(spans), 1, max(1, len(time) // BINS_PER_SPAN - degree)))
    halvings = range(int(np.log2(max(1, finest / FIRST_SPANS))), -1, -1)
    bins = [BINS_PER_SPAN * -(-finest // 2**halving) for halving in halvings]
    models = list(_models((Moments.of(time, row, count, degree) for count in bins), known))
    if not models:
        return None
    return _compared(time, row, models[-1], models[-1], order)._replace(given=True)


def _moments(time: FloatArray, row: FloatArray, degree: int, below: float) -> list[Moments]:
    """Return the moments of the tried resolutions, coarse to fine."""
    samples = len(time)
    spans = FIRST_SPANS if samples >= SHORT else FIRST_SPANS_SHORT
    most = max(samples // FEWEST_SAMPLES, min(samples // BINS_PER_SPAN, ALWAYS_SPANS), FIRST_SPANS)
    slower = max(spans, 2 * below * float(time[-1] - time[0]))
    doublings = int(np.log2(min(most, MOST_SPANS, slower) // spans))
    found = [Moments.of(time, row, BINS_PER_SPAN * spans * 2**doublings, degree)]
    for _ in range(doublings):
        found.append(found[-1].halved)
    return found[::-1]


def _models(moments: Iterable[Moments], known: KnownNoise) -> Iterator[Model]:
    """Yield the most likely model of each resolution, coarse to fine."""
    model: Model | None = None
    for each in moments:
        bins = Bins.of(each, known.deviation)
        if len(bins.means) > bins.degree + 1:
            model = most_likely(bins, model)
            yield model


def _compared(time: FloatArray, row: FloatArray, coarse: Model, fine: Model, order: int) -> Resolution:
    expected = fine.spline(fine.probes, nu=order)[fine.inside, 0]
    found = coarse.spline(fine.probes, nu=order)[fine.inside, 0]
    size = max(_rms(expected), np.finfo(float).tiny)
    change, deviation = _rms(found - expected), _deviation(coarse, order)
    explained = change < CONFIRMED * deviation
    model = fine if not explained and change < NEGLIGIBLE * size else coarse
    deviation = deviation if model is coarse else _deviation(fine, order)
    residual = _residual(time, row, model)
    # the finer of two splines near the same samples is the coarser plus what is independent of it
    more, less = (_mean_variance(each, each.variances(order)) for each in (fine, coarse))
    unexplained = float(np.sqrt(max(0.0, change**2 - abs(more - less))))
    return Resolution(model, deviation / size, change / size, unexplained, residual)


def _residual(time: FloatArray, row: FloatArray, model: Model) -> float:
    """Return the root mean square of the residual of a model."""
    some = slice(None, None, 1 + len(time) // PROBES)
    return _rms(row[some] - model.spline(time[some])[:, 0])


def _deviation(model: Model, order: int) -> float:
    """Return the deviation of a derivative by the posterior, away from the ends; see `calibration`."""
    factor = np.where(model.kinks, KINK_CAUTION, 1.0)
    return float(np.sqrt(_mean_variance(model, factor * model.variances(order, model.cautious))))


def _mean_variance(model: Model, variances: FloatArray) -> float:
    """Away from the ends, (2 spans,) to one."""
    return float(np.mean(variances[model.inside])) * model.noise_variance


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
