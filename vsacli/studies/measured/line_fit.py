"""The straight line of a measured signal over a computed one, with its lag, and standard errors of all three.

The model is measured(t) = offset + gain computed(t - shift - lag). The Gauss-Newton method finds the three
together, without outliers. Standard errors are the larger of those for white and for colored residuals, and
contain the interpolation error of the computed signal.

The effect of colored noise on unknowns is the spectral density of the scores, slope times residual, at
frequency 0. Autocovariances weighted by lag (W. K. Newey, K. D. West, Econometrica 55 (1987)) average it over
a wide band, in which derivatives of noise have much more power: errors came out 2 to 30 times too large. A
few cosines avoid this: E. Lazarus, D. J. Lewis, J. H. Stock, M. W. Watson, "HAR inference: recommendations
for practice", Journal of Business & Economic Statistics 36 (2018), section 3. For white residuals the result
is the usual covariance.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
import scipy

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.studies.measured.pairing import FEWEST_SAMPLES, LARGEST, Pairing, noise, tame

Still: TypeAlias = Literal["computed", "measured"]
"""Signal that does not change beyond rounding or noise."""

COSINES = 24
"""Number of cosines of a recording. With 8, the errors themselves were too uncertain (87 % within two of
them); with 80 for 3000 samples, those for pure derivatives of noise came out 5 times too large."""

SAMPLES_A_COSINE = 4
"""Smallest number of samples for a cosine, so that the cosines of short recordings remain the lowest ones."""


def covariance_of_sum(scores: FloatArray) -> tuple[FloatArray, int]:
    """Return the covariance of the sum of scores, (samples, unknowns), and the number of cosines used."""
    count = count_of_cosines(len(scores))
    amplitudes = scipy.fft.dct(scores, axis=0, norm="ortho")[1 : count + 1]
    return len(scores) / count * amplitudes.T @ amplitudes, count


def count_of_cosines(samples: int) -> int:
    """Return the number of cosines for a recording with this many samples."""
    return min(COSINES, -(-samples // SAMPLES_A_COSINE), max(samples - 1, 1))


LAG_SHARE = 0.05
"""Largest lag, as a share of the duration."""

MAX_STEPS = 20
"""Limit on Gauss-Newton steps; 3 to 6 suffice from the shifts of the search."""

SMALL_STEP = 0.01
"""Step of the lag, in standard errors, at which it has converged."""

WILD = 5.0
"""Residual of an outlier in standard deviations; less than one in a million of normal noise exceeds it."""

RESIDUAL_QUANTILE = 0.9, 1.645
"""Quantile of the absolute residuals that determines their standard deviation, and this quantile of a normal
distribution in standard deviations."""

MAX_OUTLIER_SHARE = 0.02
"""Largest share of outliers among the samples; motion that the line does not explain is not an outlier."""

NEAR_LARGEST = 2.0
"""Ratio to the largest residual without these few up to which a residual is not an outlier."""

MAX_OUTLIER_ROUNDS = 4
"""Number of rounds that alternate between the line and its outliers."""

SIGNIFICANT = 5.0
"""Gain in standard errors above which it is significant."""

MAX_GAIN_ERROR = 0.2
"""Standard error of a gain above which the gain is undetermined."""

CONSTANT_RATIO = 1e-6
"""Ratio of standard deviations, recording to result, below which a recording is constant in any unit."""

REST_RATIO = 0.2
"""Ratio of the standard deviations below which a recording without a significant gain does not move."""


class LineFit(NamedTuple):
    """A line through measured over computed values; NaN where the samples do not determine it.

    Attributes:
        offset, gain: coefficients of the line.
        lag: delay of the measured signal beyond the shift, s.
        offset_error, gain_error, lag_error: standard errors of offset, gain and lag.
        correlation: correlation of measured and computed values at the lag.
        used: mask of the samples of the recording without outliers, (samples,).
    """

    offset: float = math.nan
    gain: float = math.nan
    lag: float = math.nan
    offset_error: float = math.nan
    gain_error: float = math.nan
    lag_error: float = math.nan
    correlation: float = math.nan
    used: BoolArray = np.zeros(0, dtype=bool)


class _LineStep(NamedTuple):
    """A least-squares solution at one lag: unknowns, covariance, correlation, and mask of used samples."""

    unknowns: FloatArray
    covariance: FloatArray
    correlation: float
    used: BoolArray


@np.errstate(all="ignore")  # unrelated columns have infinite standard errors, as they should
def fit_line(pairing: Pairing, shift: float) -> LineFit:
    """Return the line, with a lag if the samples determine one.

    Args:
        pairing: computed and measured values.
        shift: time in the recording at which the result begins, s.
    """
    at_shift = _line_step(pairing, shift)
    if at_shift is None:
        return LineFit()
    return _line_with_errors(pairing, *(_fit_lag(pairing, shift, at_shift) or (at_shift, math.nan)))


def _fit_lag(pairing: Pairing, shift: float, start: _LineStep) -> tuple[_LineStep, float] | None:
    """Return the line and its lag; None if they are not determined."""
    max_lag, lag, step = LAG_SHARE * pairing.duration, 0.0, start
    change, error = math.inf, 0.0
    for _ in range(MAX_STEPS):
        next_step = _line_step(pairing, shift + lag, float(step.unknowns[1]))
        if next_step is None or not math.isfinite(next_step.covariance[2, 2]):
            return None
        change, error = float(next_step.unknowns[2]), _lag_error(pairing, next_step)
        lag, step = lag + max(-max_lag / 2, min(change, max_lag / 2)), next_step
        if abs(lag) > max_lag or error > max_lag:
            return None
        if abs(change) <= SMALL_STEP * error:
            return step, lag
    return (step, lag) if abs(change) <= error else None  # may alternate as samples enter at the ends


def _lag_error(pairing: Pairing, step: _LineStep) -> float:
    """Return the standard error of a lag, with the interpolation error of the computed signal."""
    slope = pairing.computed.slope(np.linspace(0.0, pairing.duration, len(pairing.time)))
    return math.hypot(math.sqrt(step.covariance[2, 2]), pairing.computed.error / math.sqrt(np.mean(slope**2)))


def _line_step(pairing: Pairing, shift: float, gain: float | None = None) -> _LineStep | None:
    """Return the least-squares solution at a shift; None if samples do not determine the unknowns.

    Args:
        pairing: computed and measured values.
        shift: time in the recording at which the result begins, s.
        gain: gain at which to linearize in a change of the shift, the third unknown; None for two unknowns.
    """
    computed, in_overlap = pairing.overlap(shift)
    if np.count_nonzero(in_overlap) < FEWEST_SAMPLES:
        return None
    columns = [np.ones(np.count_nonzero(in_overlap)), computed[in_overlap]]
    if gain is not None:
        columns.append(-gain * pairing.computed.slope((pairing.time - shift)[in_overlap]))
    design, measured = np.stack(columns, axis=1), np.clip(pairing.measured[in_overlap], -LARGEST, LARGEST)
    is_used = _inlier_mask(design, tame(pairing.measured)[in_overlap], measured)
    unknowns = None if is_used is None else _solve_scaled(design[is_used], measured[is_used])
    if is_used is None or unknowns is None:
        return None
    used_samples = in_overlap.copy()
    used_samples[in_overlap] = is_used
    return _LineStep(
        unknowns,
        _line_covariance(design[is_used], measured[is_used] - design[is_used] @ unknowns),
        float(np.corrcoef(design[is_used, 1], measured[is_used])[0, 1]),
        used_samples,
    )


def _inlier_mask(design: FloatArray, clipped: FloatArray, measured: FloatArray) -> BoolArray | None:
    """Return a mask of the rows without outliers; None if rows do not determine a line."""
    share, bound = RESIDUAL_QUANTILE
    max_outliers = max(1, math.ceil(MAX_OUTLIER_SHARE * len(design)))
    is_used, values = np.ones(len(design), dtype=bool), clipped
    for _ in range(MAX_OUTLIER_ROUNDS):
        unknowns = _solve_scaled(design[is_used], values[is_used])
        if unknowns is None:
            return None
        magnitudes, values = np.abs(measured - design @ unknowns), measured
        thresholds = (
            WILD / bound * np.quantile(magnitudes, share),
            NEAR_LARGEST * np.partition(magnitudes, -max_outliers - 1)[-max_outliers - 1],
        )
        is_used = magnitudes <= max(thresholds)
    return is_used


def _solve_scaled(design: FloatArray, values: FloatArray) -> FloatArray | None:
    """Return the least-squares solution with scaled columns; None if the columns are dependent."""
    column_norms = np.linalg.norm(design, axis=0)
    if len(design) <= design.shape[1] or not np.all(column_norms > 0):
        return None
    solution, _, rank, _ = np.linalg.lstsq(design / column_norms, values, rcond=1e-9)
    return np.asarray(solution / column_norms) if rank == design.shape[1] else None


def _line_covariance(design: FloatArray, residual: FloatArray) -> FloatArray:
    """Return the covariance of the unknowns for white or for colored residuals, whichever is larger."""
    column_norms = np.linalg.norm(design, axis=0)
    scaled = design / column_norms
    inverse = np.linalg.inv(scaled.T @ scaled)
    freedom = len(design) - design.shape[1]
    squared_sum = max(float(residual @ residual), float(np.finfo(float).tiny))
    white = squared_sum / freedom * inverse
    score_covariance, cosines = covariance_of_sum(scaled * residual[:, None])
    colored = inverse @ score_covariance @ inverse * (len(design) / freedom)
    low_frequency_ratio = float(covariance_of_sum(residual[:, None])[0][0, 0]) / squared_sum
    student_t_variance = cosines / max(
        cosines - 2, 1
    )  # variance of Student's t, for the few degrees of freedom
    fit_correction = cosines / max(
        cosines - design.shape[1], 1
    )  # the fit removes the slowest part of the noise from the residual
    ratio = np.maximum(
        np.diag(colored) / np.maximum(np.diag(white), np.finfo(float).tiny),
        low_frequency_ratio * fit_correction,
    )
    error_ratios = np.sqrt(np.maximum(1.0, student_t_variance * ratio))
    return np.asarray(white * np.outer(error_ratios, error_ratios) / np.outer(column_norms, column_norms))


def _line_with_errors(pairing: Pairing, step: _LineStep, lag: float) -> LineFit:
    """Return a line with its standard errors, including interpolation; a lag of NaN is unknown."""
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
    """Return which signal does not change beyond rounding or noise; None if both change.

    Args:
        pairing: computed and measured values.
        shift: time in the recording at which the result begins, s.
        fit: line through the values.
    """
    if not pairing.computed.moves:
        return "computed"
    computed, in_overlap = pairing.overlap(shift)
    measured_deviation, computed_deviation = (
        float(np.std(tame(pairing.measured[in_overlap]))),
        float(np.std(computed[in_overlap])),
    )
    if measured_deviation <= CONSTANT_RATIO * computed_deviation:
        return "measured"
    if abs(fit.gain) > SIGNIFICANT * fit.gain_error:
        return None
    if not fit.gain_error < MAX_GAIN_ERROR and computed_deviation**2 <= noise(tame(pairing.measured)):
        return "computed"  # its change is below the noise of the recording
    return "measured" if measured_deviation < REST_RATIO * computed_deviation else None


def root_mean_square(values: FloatArray) -> float:
    """Return the root mean square of values of any size; NaN without values."""
    largest = float(np.abs(values).max(initial=0.0))
    if not values.size or largest == 0:
        return largest if values.size else math.nan
    return largest * math.sqrt(float(np.mean((values / largest) ** 2)))
