"""Start of the computed motion in a recording: the shift at which measured signals follow computed ones.

Laboratory clocks start before the motion, and a recording may end before it or be cut out of its middle. The
shift is found in two steps. A search over all shifts selects the one at which the columns together leave the
smallest unexplained part (`pairing.py`); the part of each column is bounded. Then the lag of each column
behind that shift is fitted, with its own offset and gain (`line_fit.py`), and the lags of columns that agree
are averaged, weighted by their standard errors. If lags differ by more than these, joint positions decide on
which most of them agree: the motors of a result contain the errors of its model, which look like lags. So
neither offsets, units and signs nor a minority of delayed or exchanged columns affect the result.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import compress
from typing import NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.studies.measured.likely_causes import exchanged_places
from vsacli.studies.measured.line_fit import LineFit, fit_line
from vsacli.studies.measured.pairing import (
    FEWEST_SAMPLES,
    Moments,
    Pairing,
    exactness,
    moments_of,
    tame,
    unlikeness,
)

MAX_GRID_POINTS = 200_000
"""Largest number of grid points of the first search; refinement evaluates the signal between them."""

MIN_EXPLAINED_SHARE = 0.5
"""Share of the variance that the best shift must explain in half of the columns."""

FEWEST_COVERED = 0.5
"""Smallest overlap, as a share of the result or of the recording, whichever is shorter."""

SIMILAR_LOG_DIFFERENCE = 0.5
"""Difference in the log of the unexplained part up to which two shifts are equally good."""

MINIMUM_WIDTH = 0.05
"""Distance between shifts, as a share of the duration, within which they belong to the same minimum."""

MAX_CANDIDATES = 5
"""Number of minima of the search that are refined."""

MAX_GAP_INTERVALS = 3.0
"""Gap between samples of a column, in median intervals, that is not interpolated."""

MAX_ROUNDS = 3
"""Number of rounds that estimate the common lag; the second hardly differs from the first."""

AGREEING = 3.0
"""Largest difference of a lag from the mean of lags that agree, in standard errors."""

OUTLIER_DEVIATIONS = 3.5
"""Distance from the median, in standard deviations, from which on a column is ignored."""


class Alignment(NamedTuple):
    """The place of the result in the recording.

    Attributes:
        time_offset: time in the recording at which the result begins, s; negative if it begins earlier.
        error: standard error, s; NaN if the time was given, or no column determines it.
        others: further times that explain nearly as much, as for periodic motions.
    """

    time_offset: float
    error: float = math.nan
    others: tuple[float, ...] = ()


@np.errstate(all="ignore")  # columns with huge values, or few of them, explain nothing
def align(
    pairings: Sequence[Pairing], groups: Sequence[object], commanded: Sequence[bool]
) -> Alignment | None:
    """Return the shift that explains most; None if no shift explains half, or nothing moves.

    Args:
        pairings: pairings of the columns to align.
        groups: group of each column; columns of a group may be exchanged with each other.
        commanded: whether each computed signal was commanded, so that no error of the model is in it.
    """
    is_moving = [pairing.computed.moves and float(np.ptp(tame(pairing.measured))) > 0 for pairing in pairings]
    pairings, groups = list(compress(pairings, is_moving)), list(compress(groups, is_moving))
    commanded = list(compress(commanded, is_moving))
    if not pairings:
        return None
    candidates, others = _search_shifts(pairings)
    refined = [_refine_shift(pairings, groups, each, _grid_step(pairings)) for each in candidates]
    if not refined:
        return None
    _, shift, matched_pairings = min(refined, key=lambda each: each[0])
    if np.median([_explained(pairing, shift) for pairing in matched_pairings]) < MIN_EXPLAINED_SHARE:
        return None
    shift, error = _common_shift(matched_pairings, commanded, shift)
    return Alignment(shift, error, others if len(candidates) > 1 else ())


def _search_shifts(pairings: Sequence[Pairing]) -> tuple[list[float], tuple[float, ...]]:
    """Return the shifts of the lowest minima in order, and those that are as good as the first."""
    step = _grid_step(pairings)
    shifts, unexplained = _unexplained_on_grid(pairings, step)
    minima = np.flatnonzero(
        (unexplained < np.roll(unexplained, 1))
        & (unexplained <= np.roll(unexplained, -1))
        & (unexplained < 0)
    )
    chosen_indices: list[int] = []
    for index in minima[np.argsort(unexplained[minima])].tolist():
        if all(
            abs(shifts[index] - shifts[each]) > MINIMUM_WIDTH * pairings[0].duration
            for each in chosen_indices
        ):
            chosen_indices.append(index)
        if len(chosen_indices) == MAX_CANDIDATES:
            break
    other_shifts = [
        float(shifts[each])
        for each in chosen_indices[1:]
        if unexplained[each] <= unexplained[chosen_indices[0]] + SIMILAR_LOG_DIFFERENCE
    ]
    return [float(shifts[each]) for each in chosen_indices], tuple(other_shifts)


def _grid_step(pairings: Sequence[Pairing]) -> float:
    """Return the step of the grid: the shortest sampling interval, unless the grid would be too large."""
    span = pairings[0].duration + max(float(pairing.time[-1]) for pairing in pairings)
    return max(min(float(np.median(np.diff(each.time))) for each in pairings), span / MAX_GRID_POINTS)


def _unexplained_on_grid(pairings: Sequence[Pairing], step: float) -> tuple[FloatArray, FloatArray]:
    """Return the shifts of the grid, and the mean unexplained part of all columns at each."""
    grid = np.arange(0.0, pairings[0].duration + step / 2, step)
    recording_duration = max(float(pairing.time[-1]) for pairing in pairings)
    recorded_grid = np.arange(0.0, recording_duration + step / 2, step)
    shifts = step * np.arange(1 - len(grid), len(recorded_grid), dtype=float)
    unexplained = np.mean(
        [_unexplained_by_shift(pairing, grid, recorded_grid) for pairing in pairings], axis=0
    )
    return shifts, np.asarray(unexplained)


def _unexplained_by_shift(pairing: Pairing, grid: FloatArray, recorded_grid: FloatArray) -> FloatArray:
    """Return the unexplained part of one column at every shift, (len(grid) + len(recorded) - 1,)."""
    clipped, computed = tame(pairing.measured), pairing.computed.at(grid)
    is_computed, is_sampled = np.isfinite(computed), _sampled_mask(pairing.time, recorded_grid)
    computed_mean, measured_mean = float(np.nanmean(computed)), float(np.mean(clipped))
    computed_deviation = np.where(is_computed, computed - computed_mean, 0.0)
    measured_deviation = np.where(
        is_sampled, np.interp(recorded_grid, pairing.time, clipped) - measured_mean, 0.0
    )
    computed_weight, measured_weight = is_computed.astype(float), is_sampled.astype(float)
    common_count = np.round(_cross_correlation(computed_weight, measured_weight))
    moments = Moments(
        np.maximum(common_count, 1.0),
        _cross_correlation(computed_deviation, measured_weight),
        _cross_correlation(computed_weight, measured_deviation),
        _cross_correlation(computed_deviation**2, measured_weight),
        _cross_correlation(computed_weight, measured_deviation**2),
        _cross_correlation(computed_deviation, measured_deviation),
        apart=measured_mean - computed_mean,
        measured_variance=float(np.var(clipped)),
    )
    min_count = max(FEWEST_SAMPLES, FEWEST_COVERED * min(computed_weight.sum(), measured_weight.sum()))
    covered_share = moments.spreads()[0] / float(np.sum(computed_deviation**2))
    return np.where(
        common_count >= min_count, np.clip(covered_share, 0, 1) * unlikeness(moments, exactness(clipped)), 0.0
    )


def _sampled_mask(time: FloatArray, recorded_grid: FloatArray) -> BoolArray:
    """Return a mask of the grid points between consecutive samples without a gap."""
    steps = np.diff(time)
    has_successor = np.append(steps <= MAX_GAP_INTERVALS * np.median(steps), True)
    previous_index = np.clip(np.searchsorted(time, recorded_grid, side="right") - 1, 0, len(time) - 1)
    return np.asarray(
        (recorded_grid >= time[0]) & (recorded_grid <= time[-1]) & has_successor[previous_index]
    )


def _cross_correlation(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the sums of first[i] second[i + shift] for shifts from 1 - len(first) to len(second) - 1."""
    size = scipy.fft.next_fast_len(len(first) + len(second) - 1, real=True)
    product = scipy.fft.irfft(np.conj(scipy.fft.rfft(first, size)) * scipy.fft.rfft(second, size), size)
    return np.concatenate([product[size - len(first) + 1 :], product[: len(second)]])


def _refine_shift(
    pairings: Sequence[Pairing], groups: Sequence[object], shift: float, step: float
) -> tuple[float, float, list[Pairing]]:
    """Refine a candidate between the points of the grid.

    Returns:
        Unexplained part, refined shift, and pairings with exchanged columns corrected.
    """
    exact_values = [exactness(tame(each.measured)) for each in pairings]
    thinned_pairings = [each.thinned() for each in pairings]
    clipped_values = [tame(each.measured) for each in thinned_pairings]

    def left(pairs: Sequence[Pairing], candidate: float) -> float:
        return float(
            np.mean(
                [
                    _unexplained_part(*each, candidate)
                    for each in zip(pairs, clipped_values, exact_values, strict=True)
                ]
            )
        )

    minimum = scipy.optimize.minimize_scalar(
        lambda at: left(thinned_pairings, at),
        bounds=(shift - 2 * step, shift + 2 * step),
        method="bounded",
        options={"xatol": 1e-3 * step},
    )
    best_shift = float(minimum.x)
    followed_indices = exchanged_places(pairings, groups, best_shift)
    followed_signals = [pairings[place].computed for place in followed_indices]
    unexplained = left(
        [each._replace(computed=it) for each, it in zip(thinned_pairings, followed_signals, strict=True)],
        best_shift,
    )
    matched_pairings = [
        each._replace(computed=it) for each, it in zip(pairings, followed_signals, strict=True)
    ]
    return unexplained, best_shift, matched_pairings


def _unexplained_part(pairing: Pairing, tamed: FloatArray, exact: float, shift: float) -> float:
    """Return the unexplained part of one column at a shift."""
    moments = moments_of(pairing.overlap(shift)[0], tamed)
    if moments.samples < FEWEST_SAMPLES:
        return 0.0
    covered_share = float(moments.spreads()[0] / moments.samples) / pairing.computed.spread**2
    return min(1.0, covered_share) * float(unlikeness(moments, exact))


def _explained(pairing: Pairing, shift: float) -> float:
    """Return the share of the variance of measured values that a line explains in the overlap."""
    moments = moments_of(pairing.overlap(shift)[0], tame(pairing.measured))
    computed, measured, product = moments.spreads()
    if moments.samples < FEWEST_SAMPLES or not computed * measured > 0:
        return 0.0
    freedom = (moments.samples - 1) / max(float(moments.samples) - 3, 0.5)
    return float(1 - (1 - product**2 / (computed * measured)) * freedom)


def _common_shift(
    pairings: Sequence[Pairing], commanded: Sequence[bool], shift: float
) -> tuple[float, float]:
    """Return the time shift on which the columns agree, and its standard error."""
    error = math.nan
    for _ in range(MAX_ROUNDS):
        fits = [fit_line(pairing, shift) for pairing in pairings]
        usable = [math.isfinite(fit.lag) and fit.correlation**2 >= MIN_EXPLAINED_SHARE for fit in fits]
        if not any(usable):
            break
        of_commanded = list(compress(fits, np.logical_and(usable, commanded)))
        fits = list(compress(fits, usable))
        sure = 2 * np.count_nonzero(_agreeing(of_commanded)) > len(of_commanded)
        late, error = _average_lag(of_commanded if sure and not lags_agree(*_lags(fits)) else fits)
        shift += late
    return shift, error


def lags_agree(lags: FloatArray, errors: FloatArray) -> bool:
    """Return whether lags differ from their mean by no more than their standard errors explain."""
    return bool(np.all(np.abs(lags - mean_of_effects(lags, errors)[0]) <= AGREEING * errors))


def _lags(fits: Sequence[LineFit]) -> tuple[FloatArray, FloatArray]:
    return np.array([fit.lag for fit in fits]), np.array([fit.lag_error for fit in fits])


def _average_lag(fits: Sequence[LineFit]) -> tuple[float, float]:
    """Return the weighted mean lag of columns that agree, and its standard error.

    If lags scatter more than their errors explain, all errors are increased by that scatter.
    """
    is_kept = _agreeing(fits)
    if 2 * np.count_nonzero(is_kept) <= len(fits):
        is_kept[:] = True  # without a majority, no column can be called wrong
    lags, errors = _lags(fits)
    return mean_of_effects(lags[is_kept], errors[is_kept])


def _agreeing(fits: Sequence[LineFit]) -> BoolArray:
    """Return a mask of the columns whose lags agree with the median."""
    if not fits:
        return np.zeros(0, dtype=bool)
    lags, errors = _lags(fits)
    bounded = np.maximum(errors, np.median(errors))
    middle = _weighted_median(lags, 1 / bounded)
    scatter = 1.4826 * _weighted_median(np.abs(lags - middle), 1 / bounded)
    of_middle = 1.25 * float(np.sqrt(1 / np.sum(1 / bounded**2)))
    wide = np.sqrt(errors**2 + max(0.0, scatter**2 - float(np.median(errors)) ** 2) + of_middle**2)
    return np.asarray(np.abs(lags - middle) <= OUTLIER_DEVIATIONS * wide)


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    order = np.argsort(values)
    sums = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(sums, sums[-1] / 2)])


def mean_of_effects(values: FloatArray, errors: FloatArray) -> tuple[float, float]:
    """Return the mean of values that scatter beyond their errors, and its standard error.

    See R. DerSimonian, N. Laird, "Meta-analysis in clinical trials", Controlled Clinical Trials 7 (1986).
    """
    weights = 1 / errors**2
    mean = float(weights @ values / weights.sum())
    excess = float(weights @ (values - mean) ** 2) - (len(values) - 1)
    between = (
        max(0.0, excess / float(weights.sum() - weights @ weights / weights.sum()))
        if len(values) > 1
        else 0.0
    )
    weights = 1 / (errors**2 + between)
    return float(weights @ values / weights.sum()), float(np.sqrt(1 / weights.sum()))
