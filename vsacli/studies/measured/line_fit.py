"""The straight line of a measured signal over a computed one, with its lag, and standard errors of all three.

The model is measured(t) = offset + gain computed(t - shift - lag). Gauss-Newton finds the three together;
single samples far outside what the others leave are taken out. Standard errors are the larger of those of
white and of colored residuals, and contain the error of interpolation of the computed signal.

What noise of any color does to unknowns is what the scores, slope times residual, have at frequency 0.
Autocovariances weighted by lag (W. K. Newey, K. D. West, Econometrica 55 (1987)) smear that over a wide band,
and derivatives of noise have much more there: errors came out 2 to 30 times too large. A few cosines do not:
E. Lazarus, D. J. Lewis, J. H. Stock, M. W. Watson, "HAR inference: recommendations for practice", Journal of
Business & Economic Statistics 36 (2018), section 3. Of white residuals it is the usual covariance.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.studies.measured.agreement import Still
from vsacli.studies.measured.pairing import FEWEST_SAMPLES, LARGEST, Pairing, noise, tame

COSINES = 24
"""Cosines of a record that count. With 8 the errors themselves were too uncertain (87 % within two of them);
with 80, of 3000 samples, those of pure derivatives of noise came out 5 times too large."""

SAMPLES_A_COSINE = 4
"""Smallest number of samples for a cosine, so that the cosines of short recordings remain the lowest ones."""


def covariance_of_sum(scores: FloatArray) -> tuple[FloatArray, int]:
    """Return the covariance of the sum of scores, (samples, unknowns), and the number of cosines used."""
    from scipy.fft import dct

    count = count_of_cosines(len(scores))
    amplitudes = dct(scores, axis=0, norm="ortho")[1 : count + 1]
    return len(scores) / count * amplitudes.T @ amplitudes, count


def count_of_cosines(samples: int) -> int:
    """Return how many cosines count in a record of this many samples."""
    return min(COSINES, -(-samples // SAMPLES_A_COSINE), max(samples - 1, 1))


LAG_SHARE = 0.05
"""Share of the duration within which a lag is looked for."""

MOST_STEPS = 20
"""Largest number of Gauss-Newton steps; from shifts of the search it takes 3 to 6."""

SMALL_STEP = 0.01
"""Step, in standard errors of the lag, after which it is found."""

WILD = 5.0
"""Deviations beyond which a residual is left out; of normal noise that is less than one in a million."""

NINE_OF_TEN = 0.9, 1.645
"""Share of the residuals that tells their deviation, and the bound of that share of normal ones in
deviations."""

FEW = 0.02
"""Share of the samples that is left out at most; motion that the line does not explain is no wild sample."""

NEAR_LARGEST = 2.0
"""Times the largest residual but for those few, up to which a residual is like the others."""

TRIALS = 4
"""Rounds in which the line and the samples that count are found in turn."""

SIGNIFICANT = 5.0
"""Standard errors from which on a gain is one."""

VAGUE = 0.2
"""Standard error of a gain from which on it says nothing."""

CONSTANT = 1e-6
"""Deviation of a recording, over that of the result, below which it is constant in any unit."""

RESTS = 0.2
"""Deviation of a recording that does not follow, over that of the result, below which it does not
move."""


class LineFit(NamedTuple):
    """A line through measured over computed values; NaN where the samples do not determine it.

    Attributes:
        offset, gain: of the line.
        lag: how much later than the shift the measured signal follows, s.
        offset_error, gain_error, lag_error: standard errors.
        correlation: of measured and computed values, at the lag.
        used: which samples of the recording counted, (samples,).
    """

    offset: float = math.nan
    gain: float = math.nan
    lag: float = math.nan
    offset_error: float = math.nan
    gain_error: float = math.nan
    lag_error: float = math.nan
    correlation: float = math.nan
    used: BoolArray = np.zeros(0, dtype=bool)


class _Step(NamedTuple):
    """Least squares at one lag: unknowns, their covariance, and the residual."""

    unknowns: FloatArray
    covariance: FloatArray
    correlation: float
    used: BoolArray


@np.errstate(all="ignore")  # columns without any relation end in infinite errors, which say so
def fit_line(pairing: Pairing, shift: float) -> LineFit:
    """Return the line, with a lag if the samples determine one, else without.

    Args:
        pairing: computed and measured values.
        shift: time of the recording, s, at which the result begins.
    """
    at_shift = _step(pairing, shift)
    if at_shift is None:
        return LineFit()
    return _line(pairing, *(_lagging(pairing, shift, at_shift) or (at_shift, math.nan)))


def _lagging(pairing: Pairing, shift: float, start: _Step) -> tuple[_Step, float] | None:
    """Return the line and its lag; None if they are not determined."""
    bound, lag, step = LAG_SHARE * pairing.duration, 0.0, start
    change, error = math.inf, 0.0
    for _ in range(MOST_STEPS):
        found = _step(pairing, shift + lag, float(step.unknowns[1]))
        if found is None or not math.isfinite(found.covariance[2, 2]):
            return None
        change, error = float(found.unknowns[2]), _lag_error(pairing, found)
        lag, step = lag + max(-bound / 2, min(change, bound / 2)), found
        if abs(lag) > bound or error > bound:
            return None
        if abs(change) <= SMALL_STEP * error:
            return step, lag
    return (step, lag) if abs(change) <= error else None  # samples at the ends come and go


def _lag_error(pairing: Pairing, step: _Step) -> float:
    """Standard error of a lag, to which interpolation of the computed signal adds."""
    slope = pairing.computed.slope(np.linspace(0.0, pairing.duration, len(pairing.time)))
    return math.hypot(math.sqrt(step.covariance[2, 2]), pairing.computed.error / math.sqrt(np.mean(slope**2)))


def _step(pairing: Pairing, shift: float, gain: float | None = None) -> _Step | None:
    """Least squares at a shift; None if there are too few samples, or they do not tell the unknowns apart.

    Args:
        pairing: computed and measured values.
        shift: time of the recording, s, at which the result begins.
        gain: about which the change of the shift is the third unknown; without it there are two.
    """
    computed, there = pairing.overlap(shift)
    if np.count_nonzero(there) < FEWEST_SAMPLES:
        return None
    columns = [np.ones(np.count_nonzero(there)), computed[there]]
    if gain is not None:
        columns.append(-gain * pairing.computed.slope((pairing.time - shift)[there]))
    design, measured = np.stack(columns, axis=1), np.clip(pairing.measured[there], -LARGEST, LARGEST)
    kept = _usual_rows(design, tame(pairing.measured)[there], measured)
    unknowns = None if kept is None else _solved(design[kept], measured[kept])
    if kept is None or unknowns is None:
        return None
    used = there.copy()
    used[there] = kept
    return _Step(
        unknowns,
        _covariance(design[kept], measured[kept] - design[kept] @ unknowns),
        float(np.corrcoef(design[kept, 1], measured[kept])[0, 1]),
        used,
    )


def _usual_rows(design: FloatArray, tamed: FloatArray, measured: FloatArray) -> BoolArray | None:
    """Rows whose residuals are like the others; None if no line goes through them."""
    share, bound = NINE_OF_TEN
    few = max(1, math.ceil(FEW * len(design)))
    kept, values = np.ones(len(design), dtype=bool), tamed
    for _ in range(TRIALS):
        unknowns = _solved(design[kept], values[kept])
        if unknowns is None:
            return None
        size, values = np.abs(measured - design @ unknowns), measured
        usual = WILD / bound * np.quantile(size, share), NEAR_LARGEST * np.partition(size, -few - 1)[-few - 1]
        kept = size <= max(usual)
    return kept


def _solved(design: FloatArray, values: FloatArray) -> FloatArray | None:
    """Least squares by columns of one size; None if the columns do not differ."""
    sizes = np.linalg.norm(design, axis=0)
    if len(design) <= design.shape[1] or not np.all(sizes > 0):
        return None
    solution, _, rank, _ = np.linalg.lstsq(design / sizes, values, rcond=1e-9)
    return np.asarray(solution / sizes) if rank == design.shape[1] else None


def _covariance(design: FloatArray, residual: FloatArray) -> FloatArray:
    """Return the covariance of the unknowns, of white or of colored residuals, whichever is larger."""
    sizes = np.linalg.norm(design, axis=0)
    scaled = design / sizes
    inverse = np.linalg.inv(scaled.T @ scaled)
    freedom = len(design) - design.shape[1]
    squares = max(float(residual @ residual), float(np.finfo(float).tiny))
    white = squares / freedom * inverse
    meat, cosines = covariance_of_sum(scaled * residual[:, None])
    colored = inverse @ meat @ inverse * (len(design) / freedom)
    slow = float(covariance_of_sum(residual[:, None])[0][0, 0]) / squares
    rough = cosines / max(cosines - 2, 1)  # variance of Student's t, since so few cosines tell roughly
    fitted = cosines / max(
        cosines - design.shape[1], 1
    )  # the line takes the slowest part of the noise with it
    ratio = np.maximum(np.diag(colored) / np.maximum(np.diag(white), np.finfo(float).tiny), slow * fitted)
    larger = np.sqrt(np.maximum(1.0, rough * ratio))
    return np.asarray(white * np.outer(larger, larger) / np.outer(sizes, sizes))


def _line(pairing: Pairing, step: _Step, lag: float) -> LineFit:
    """Return a line with its standard errors, to which interpolation adds; a lag of NaN is unknown."""
    offset, gain = (float(each) for each in step.unknowns[:2])
    error, deviations = pairing.computed.error, np.sqrt(np.diag(step.covariance))
    return LineFit(
        offset=offset,
        gain=gain,
        lag=lag,
        offset_error=math.hypot(deviations[0], abs(gain) * error),
        gain_error=math.hypot(deviations[1], abs(gain) * error / pairing.computed.spread),
        lag_error=_lag_error(pairing, step) if math.isfinite(lag) else math.nan,
        correlation=step.correlation,
        used=step.used,
    )


def still_signal(pairing: Pairing, shift: float, fit: LineFit) -> Still | None:
    """Return the signal that does not move beyond rounding or noise; None if both move.

    Args:
        pairing: computed and measured values.
        shift: time of the recording, s, at which the result begins.
        fit: the line through them.
    """
    if not pairing.computed.moves:
        return "computed"
    computed, there = pairing.overlap(shift)
    moved, follows = float(np.std(tame(pairing.measured[there]))), float(np.std(computed[there]))
    if moved <= CONSTANT * follows:
        return "measured"
    if abs(fit.gain) > SIGNIFICANT * fit.gain_error:
        return None
    if not fit.gain_error < VAGUE and follows**2 <= noise(tame(pairing.measured)):
        return "computed"  # so little that a recording with this noise cannot tell
    return "measured" if moved < RESTS * follows else None


def root_mean_square(values: FloatArray) -> float:
    """Return the root mean square of values of any size; NaN of none."""
    largest = float(np.abs(values).max(initial=0.0))
    if not values.size or largest == 0:
        return largest if values.size else math.nan
    return largest * math.sqrt(float(np.mean((values / largest) ** 2)))
