"""The resolution of a smoothing spline: from coarse to fine, until the next one confirms it.

At each resolution, `most_likely` searches penalties and correlation of the noise of maximum restricted
likelihood. `find_resolution` compares the highest derivative of successive resolutions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.fits.bins import BINS_PER_SPAN, BinMoments, Bins
from vsacli.trajectory.fits.penalized import Model, deviance, enough_spans, evidence, segment_of

CORRELATIONS = np.array([-0.5, -0.25, 0.0, 0.2, 0.4, 0.55, 0.7, 0.8, 0.87, 0.92, 0.95, 0.98])
"""Correlations of the noise of neighboring means in the first search."""

SMALL_CORRELATIONS = np.array([0.01, 0.03, 0.1])
"""Further correlations if the noise of samples is known, since that of means then depends on them."""

FINER_CORRELATIONS = np.array([-0.3, -0.1, 0.0, 0.1, 0.3])
"""Steps around the best correlation, of its inverse hyperbolic tangent; they are applied twice."""

FIRST_DECADES = np.arange(-6.0, 19.0)
"""Penalties at the coarsest resolution, as powers of ten: from no penalty to a polynomial."""

NEAR_DECADES = np.arange(-5.0, 5.0)
"""Factors to penalties of the coarser resolution, as powers of ten."""

NEAR_CORRELATION = 1.2
"""Largest distance from the correlation of the coarser resolution, of inverse hyperbolic tangents."""

MAX_GRID_SPANS = 2048
"""Number of spans above which the grid is evaluated on stretches only, since it gives an initial model: that
saves half of the time."""

STRETCHES = 8

MAX_SEGMENTS = 64
FEWEST_DIFFERENCES = 4
"""Fewest differences in a segment."""

UPDATES = 30
LEAST_GAIN = 0.05
"""Smallest gain of twice the log likelihood after which updates continue."""


def most_likely(bins: Bins, coarser: Model | None) -> Model:
    """Search for the model of maximum restricted likelihood.

    Args:
        bins: means of the recording.
        coarser: model with half as many spans, around which to search; None to search everywhere.
    """
    model = _halve_segments(_update_penalties(_best_of_grids(bins, _grids(bins, coarser))))
    for _ in range(1 if _is_long(bins) else 2):
        model = _update_penalties(_refine_correlation(model))
    return model


class _Grid(NamedTuple):
    """A grid of models.

    Attributes:
        correlations: correlations of the noise of neighboring means.
        shape: common logarithms of the penalties of segments, (segments,).
        decades: numbers that are added to `shape`.
    """

    correlations: FloatArray
    shape: FloatArray
    decades: FloatArray

    def penalties(self, differences: int) -> FloatArray:
        """Return the penalties of each difference of coefficients, (decades, differences)."""
        each = self.shape[segment_of(differences, len(self.shape))]
        return np.asarray(10.0 ** (each + self.decades[:, None]))


def _grids(bins: Bins, coarser: Model | None) -> list[_Grid]:
    """Return the grids to search: near the coarser model, with its segments if long, and everywhere."""
    correlations = CORRELATIONS if bins.noise is None else np.append(CORRELATIONS, SMALL_CORRELATIONS)
    zero_shape = np.zeros(1)
    if coarser is None:
        return [_Grid(correlations, zero_shape, FIRST_DECADES)]
    is_near = np.abs(np.arctanh(correlations) - np.arctanh(coarser.whitened.correlation)) <= NEAR_CORRELATION
    log_penalties = np.log10(coarser.each_penalty if _is_long(bins) else coarser.penalties)
    shape = log_penalties if _is_long(bins) else np.mean(log_penalties, keepdims=True)
    # With half the span, differences of order n shrink by 2^n, noise of a mean grows by 2^(1/2).
    growth = (2 * bins.degree - 1) * np.log10(2)
    # A motion that counted as noise on coarser bins, e.g. a sweep, may be resolved now: search everywhere.
    coarse_grid = _Grid(CORRELATIONS[::3], zero_shape, FIRST_DECADES[::3])
    return [_Grid(correlations[is_near], shape + growth, NEAR_DECADES), coarse_grid]


def _best_of_grids(bins: Bins, grids: Sequence[_Grid]) -> Model:
    """Return the model of largest likelihood on the grids; for long recordings by distant stretches only."""
    differences = bins.coefficients - bins.degree
    spans = MAX_GRID_SPANS // STRETCHES if _is_long(bins) else bins.spans
    first_spans = np.linspace(0, bins.spans - spans, STRETCHES if _is_long(bins) else 1).astype(int).tolist()
    stretches = [(bins.stretch(first, spans), slice(first, first + spans)) for first in first_spans]
    candidates = []
    for grid in grids:
        for correlation in grid.correlations.tolist():
            whitened_stretches = [(part, part.whitened(correlation), of) for part, of in stretches]
            for penalties in grid.penalties(differences):
                fit = deviance(
                    [evidence(part, whitened, penalties[of]) for part, whitened, of in whitened_stretches]
                )
                candidates.append((fit, correlation, penalties, len(grid.shape)))
    _, correlation, penalties, segments = min(candidates, key=lambda each: each[0])
    return Model(bins, bins.whitened(correlation), penalties, segments)


def _is_long(bins: Bins) -> bool:
    return bins.spans > MAX_GRID_SPANS


def _update_penalties(model: Model) -> Model:
    """Return the model after updates of its penalties, each accepted if it increases the likelihood."""
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


def _halve_segments(model: Model) -> Model:
    """Return the model with segments halved as long as the likelihood increases.

    Each additional segment must gain more than its parameter would by chance.
    """
    max_segments = min(MAX_SEGMENTS, len(model.penalties) // FEWEST_DIFFERENCES)
    trial = model
    while 2 * trial.segments <= max_segments and trial.segments <= 2 * model.segments:
        trial = _update_penalties(Model(model.bins, model.whitened, trial.penalties, 2 * trial.segments))
        if trial.deviance < model.deviance - (trial.segments - model.segments) - 1:
            model = trial
    return model


def _refine_correlation(model: Model) -> Model:
    """Return the model with the most likely correlation near its own."""
    bins, center = model.bins, np.arctanh(model.whitened.correlation)
    candidates = np.clip(np.tanh(center + FINER_CORRELATIONS), -0.6, 0.985).tolist()
    models = [Model(bins, bins.whitened(each), model.penalties, model.segments) for each in candidates]
    return min(models, key=lambda each: each.deviance)


FIRST_SPANS, FIRST_SPANS_SHORT = 32, 4
"""Number of spans of the coarsest resolution, and of that for recordings of fewer than `SHORT` samples."""

SHORT = 256

FEWEST_SAMPLES, ALWAYS_SPANS, MOST_SPANS = 3, 128, 32768
"""Fewest samples per span; number of spans that is possible with fewer; largest number of spans. Noise of
fewer successive samples hides what a finer resolution would show, and computing time grows with the spans."""

NEGLIGIBLE = 0.02
"""Relative change of the highest derivative from one resolution to the next that requires no finer one. If
noise does not explain it, the next is used. With a fifth, splines followed filtered noise in a sweep."""

CONFIRMING_DEVIATIONS = 1.0
"""Number of standard deviations by which this derivative may change if a resolution is confirmed. With more,
half the necessary knots were accepted for rest-to-rest motions, and the true error exceeded two deviations in
up to 30 % of the samples."""

KINK_CAUTION = 5.0
"""Factor of the variance where motion starts or stops, in the comparison of resolutions: root mean square
errors are up to 2.2 deviations there."""

MAX_DEVIATION = 0.25
"""Largest relative deviation of the highest derivative of an accepted resolution. It was 0.3 and more for
motions whose fast parts counted as noise."""

CLOSE_RESIDUAL_RATIO = 3.0
"""Largest residual of a resolution that is considered if none is accepted, over the smallest of all. A coarse
one may state the smallest deviation of a derivative that it does not resolve: with a factor of 100, steps of
velocity smoothed over 50 ms were missed by 0.03 rad, and motor torques were off by 17 % with a stated 7 %."""

CHECKED_SPANS = 256
"""Number of spans at which a search that has accepted nothing asks whether finer ones can show anything. Most
searches have ended before; the question takes as long as the resolution of 32 spans. Without it, a fit to
10,000 samples of white noise takes 4 times as long."""

MAX_RESIDUAL_SHARE = 0.3
"""Largest residual over the recording's standard deviation. A larger one is motion that only the finest
resolution follows, which no other confirms."""

PROBES = 16384
"""Approximate number of samples from which a residual is computed."""

SPANS_PER_PERIOD = 4.0
"""Spans per period of the highest frequency of a motion of known bandwidth: for a sine of that frequency the
fourth derivative of a spline of degree 7 is off by less than 1 %."""


LEFT_OVER = 2.0
"""Largest residual over known white noise; a larger one is motion that was left out. Noise that varies along
the recording has a median of up to 1.5 times less than its root mean square."""

SETTLED = 1.15
"""Largest residual over known white noise that is this noise alone; the noise is known to some 10 %."""


class KnownNoise(NamedTuple):
    """Noise and bandwidth of a component as given by the user, or noise as found in the samples.

    Attributes:
        deviation: standard deviation of a sample's noise; None to estimate it.
        bandwidth: frequency above which there is no motion, Hz; None to determine it from the recording.
        white: whether the deviation is that of white noise found in the samples.
    """

    deviation: float | None = None
    bandwidth: float | None = None
    white: bool = False


class Resolution(NamedTuple):
    """A resolution in comparison with the next.

    Attributes:
        model: model of the coarser one, or of the finer if noise does not explain a negligible change.
        other: model of the other one.
        deviation: relative standard deviation of the highest derivative due to noise.
        change: relative change of this derivative from one to the other.
        unexplained: part of the change that noise does not explain, in units of the row per s^order.
        residual: root mean square residual of the model.
        given: whether it follows from a given bandwidth.
        settled: whether the residual is known white noise alone.
        refused: whether it leaves motion out, as its residual shows.
    """

    model: Model
    other: Model
    deviation: float
    change: float
    unexplained: float
    residual: float
    given: bool = False
    settled: bool = False
    refused: bool = False

    @property
    def total(self) -> float:
        """Deviation and change combined, since an unresolved part is an error, too."""
        return float(np.hypot(self.deviation, self.change))

    @property
    def accepted(self) -> bool:
        """Whether the change to the next resolution does not exceed that by noise, and both are small."""
        confirmed = self.settled or self.change < max(CONFIRMING_DEVIATIONS * self.deviation, NEGLIGIBLE)
        return self.given or (confirmed and self.total < MAX_DEVIATION and not self.refused)


def find_resolution(
    time: FloatArray,
    row: FloatArray,
    degree: int,
    order: int,
    known: KnownNoise,
    below: float = np.inf,
) -> Resolution | None:
    """Return the first resolution that the next one confirms, or that of a given bandwidth.

    The search goes from coarse to fine, since the color of the noise does not matter above the frequency at
    which the motion falls below the noise; only a finer resolution would depend on it. It ends early where
    all that a finer resolution could show is noise. If white noise is known, a resolution must leave over
    no more than this, and then needs no other to confirm it.

    Args:
        time: times, (samples,), s.
        row: values of mean 0 and standard deviation 1, (samples,).
        degree: degree of the spline.
        order: order of the highest derivative that is needed.
        known: given noise, in units of the row, and bandwidth.
        below: frequency, Hz, that no resolution may follow.

    Returns:
        The resolution. If none is confirmed, that with the smallest deviation among those close to the
        samples; the finest if none is close; None if there is none.
    """
    if known.bandwidth is not None:
        return _resolution_of_bandwidth(time, row, degree, order, known)
    resolutions = []
    finest: Model | None = None
    max_spans = np.inf
    moments = _moments(time, row, degree, below, BINS_PER_SPAN if known.white else FEWEST_SAMPLES)
    for coarse, finest in pairwise(_models(moments, known)):
        resolutions.append(_judge_residual(_compare_resolutions(time, row, coarse, finest, order), known))
        if resolutions[-1].accepted:
            return resolutions[-1]
        if finest.bins.spans == CHECKED_SPANS:
            max_spans = enough_spans(time, row)
        if finest.bins.spans >= max_spans:
            break
    if finest is not None and known.white:
        last_resolution = _judge_residual(_compare_resolutions(time, row, finest, finest, order), known)
        if last_resolution.settled and last_resolution.accepted:
            return last_resolution
    min_residual = min((each.residual for each in resolutions), default=0.0)
    if finest is not None and min_residual > MAX_RESIDUAL_SHARE:
        return resolutions[-1]._replace(
            model=finest, other=resolutions[-1].model, residual=_residual(time, row, finest)
        )
    close_resolutions = [each for each in resolutions if each.residual <= CLOSE_RESIDUAL_RATIO * min_residual]
    return min(close_resolutions, key=lambda each: each.total, default=None)


def _resolution_of_bandwidth(
    time: FloatArray, row: FloatArray, degree: int, order: int, known: KnownNoise
) -> Resolution | None:
    assert known.bandwidth is not None
    spans = SPANS_PER_PERIOD * known.bandwidth * float(time[-1] - time[0])
    finest_spans = int(np.clip(np.ceil(spans), 1, max(1, len(time) // BINS_PER_SPAN - degree)))
    halvings = range(int(np.log2(max(1, finest_spans / FIRST_SPANS))), -1, -1)
    bin_counts = [BINS_PER_SPAN * -(-finest_spans // 2**halving) for halving in halvings]
    models = list(_models((BinMoments.of(time, row, count, degree) for count in bin_counts), known))
    if not models:
        return None
    return _compare_resolutions(time, row, models[-1], models[-1], order)._replace(given=True)


def _judge_residual(resolution: Resolution, known: KnownNoise) -> Resolution:
    """Return the resolution judged by what it leaves over, if white noise is known."""
    if not known.white or known.deviation is None:
        return resolution
    ratio = resolution.residual / known.deviation
    return resolution._replace(settled=ratio <= SETTLED, refused=ratio > LEFT_OVER)


def _moments(
    time: FloatArray, row: FloatArray, degree: int, below: float, fewest_samples: int
) -> list[BinMoments]:
    """Return the moments of all resolutions, from coarse to fine."""
    samples = len(time)
    spans = FIRST_SPANS if samples >= SHORT else FIRST_SPANS_SHORT
    max_spans = max(samples // fewest_samples, min(samples // BINS_PER_SPAN, ALWAYS_SPANS), FIRST_SPANS)
    max_useful_spans = max(spans, 2 * below * float(time[-1] - time[0]))
    doublings = int(np.log2(min(max_spans, MOST_SPANS, max_useful_spans) // spans))
    moments = [BinMoments.of(time, row, BINS_PER_SPAN * spans * 2**doublings, degree)]
    for _ in range(doublings):
        moments.append(moments[-1].halved)
    return moments[::-1]


def _models(moments: Iterable[BinMoments], known: KnownNoise) -> Iterator[Model]:
    """Yield the most likely model of each resolution, from coarse to fine."""
    model: Model | None = None
    for each in moments:
        bins = Bins.of(each, known.deviation)
        if len(bins.means) > bins.degree + 1:
            model = most_likely(bins, model)
            yield model


def _compare_resolutions(
    time: FloatArray, row: FloatArray, coarse: Model, fine: Model, order: int
) -> Resolution:
    fine_derivative = fine.spline(fine.probes, nu=order)[fine.inside, 0]
    coarse_derivative = coarse.spline(fine.probes, nu=order)[fine.inside, 0]
    derivative_rms = max(_rms(fine_derivative), np.finfo(float).tiny)
    change, deviation = _rms(coarse_derivative - fine_derivative), _deviation(coarse, order)
    is_explained = change < CONFIRMING_DEVIATIONS * deviation
    model = fine if not is_explained and change < NEGLIGIBLE * derivative_rms else coarse
    deviation = deviation if model is coarse else _deviation(fine, order)
    residual = _residual(time, row, model)
    # The finer of two splines near the same samples is the coarser plus an independent part.
    fine_variance, coarse_variance = (_mean_variance(each, each.variances(order)) for each in (fine, coarse))
    unexplained = float(np.sqrt(max(0.0, change**2 - abs(fine_variance - coarse_variance))))
    return Resolution(
        model,
        coarse if model is fine else fine,
        deviation / derivative_rms,
        change / derivative_rms,
        unexplained,
        residual,
    )


def _residual(time: FloatArray, row: FloatArray, model: Model) -> float:
    probe_slice = slice(None, None, 1 + len(time) // PROBES)
    return _rms(row[probe_slice] - model.spline(time[probe_slice])[:, 0])


def _deviation(model: Model, order: int) -> float:
    """Return the standard deviation of a derivative by the posterior, away from the ends."""
    factor = np.where(model.kinks, KINK_CAUTION, 1.0)
    return float(np.sqrt(_mean_variance(model, factor * model.variances(order, model.cautious))))


def _mean_variance(model: Model, variances: FloatArray) -> float:
    """Return the mean variance away from the ends, from (2 spans,) in units of the noise variance."""
    return float(np.mean(variances[model.inside])) * model.noise_variance


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
