"""Start of the computed motion in a recording: the shift at which measured signals follow computed ones.

Clocks of a laboratory start before the motion, and a recording may end before it or be cut out of its middle.
Two steps find the shift. A search over all shifts takes the one at which the columns together leave least
unexplained (`likeness.py`), each column's part of which is bounded. Then each column says by how much it lags
behind that shift, with offset and gain of its own (`line_fit.py`), and the columns that agree are averaged,
weighted by their standard errors. So neither offsets, units and signs nor a minority of columns that are late
or exchanged move the result.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

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

MOST_POINTS = 200_000
"""Points of the grid on which the shift is looked for first; the computed signal is known between them."""

EXPLAINED = 0.5
"""Share of the variance that the best shift must explain in half of the columns."""

FEWEST_COVERED = 0.5
"""Share of the result, or of the recording if that is shorter, over which both must overlap."""

AS_GOOD = 0.5
"""Difference of the logarithms of what two shifts leave unexplained, up to which one is as good as the
other."""

OWN_WIDTH = 0.05
"""Share of the duration around a shift that belongs to the same minimum."""

MOST_CANDIDATES = 5
"""Minima of the search that are looked at closely."""

LONGEST_STEP = 3.0
"""Steps between samples of a column, in usual ones, beyond which nothing is known between them."""

ROUNDS = 3
"""Rounds in which the columns vote on their lag; the second answer hardly differs from the first."""

APART = 3.5
"""Distance from the middle, in deviations, from which on a column does not count."""


class Alignment(NamedTuple):
    """The place of the result in the recording.

    Attributes:
        begins_at: time of the recording, s, at which the result begins; negative if that is before it.
        error: standard error, s; NaN if it was given, or no column says.
        others: further times that explain nearly as much, as in periodic motions.
    """

    begins_at: float
    error: float = math.nan
    others: tuple[float, ...] = ()


@np.errstate(all="ignore")  # numbers too large, or too few, explain nothing
def align(pairings: Sequence[Pairing], groups: Sequence[object]) -> Alignment | None:
    """Return the shift that explains most; None if there is none that explains half, or nothing moves.

    Args:
        pairings: all columns that may say something.
        groups: for each, the property shared with columns it may have been exchanged with.
    """
    moving = [pairing.computed.moves and float(np.ptp(tame(pairing.measured))) > 0 for pairing in pairings]
    pairings = [pairing for pairing, moves in zip(pairings, moving, strict=True) if moves]
    groups = [group for group, moves in zip(groups, moving, strict=True) if moves]
    if not pairings:
        return None
    candidates, others = _search(pairings)
    refined = [_refined(pairings, groups, each, _step(pairings)) for each in candidates]
    if not refined:
        return None
    _, shift, paired = min(refined, key=lambda each: each[0])
    if np.median([_explained(pairing, shift) for pairing in paired]) < EXPLAINED:
        return None
    shift, error = _agreed(paired, shift)
    return Alignment(shift, error, others if len(candidates) > 1 else ())


def _search(pairings: Sequence[Pairing]) -> tuple[list[float], tuple[float, ...]]:
    """Shifts of the lowest minima, lowest first, and those besides the first that are as good."""
    step = _step(pairings)
    shifts, left = _on_grid(pairings, step)
    minima = np.flatnonzero((left < np.roll(left, 1)) & (left <= np.roll(left, -1)) & (left < 0))
    chosen: list[int] = []
    for index in minima[np.argsort(left[minima])].tolist():
        if all(abs(shifts[index] - shifts[each]) > OWN_WIDTH * pairings[0].duration for each in chosen):
            chosen.append(index)
        if len(chosen) == MOST_CANDIDATES:
            break
    others = [float(shifts[each]) for each in chosen[1:] if left[each] <= left[chosen[0]] + AS_GOOD]
    return [float(shifts[each]) for each in chosen], tuple(others)


def _step(pairings: Sequence[Pairing]) -> float:
    """Return the step of the grid: that of the most frequent column, unless finer than the grid allows."""
    span = pairings[0].duration + max(float(pairing.time[-1]) for pairing in pairings)
    return max(min(float(np.median(np.diff(each.time))) for each in pairings), span / MOST_POINTS)


def _on_grid(pairings: Sequence[Pairing], step: float) -> tuple[FloatArray, FloatArray]:
    """Shifts, and the unexplained part at each, the mean of all columns."""
    grid = np.arange(0.0, pairings[0].duration + step / 2, step)
    last = max(float(pairing.time[-1]) for pairing in pairings)
    recorded = np.arange(0.0, last + step / 2, step)
    shifts = step * np.arange(1 - len(grid), len(recorded), dtype=float)
    left = np.mean([_by_shift(pairing, grid, recorded) for pairing in pairings], axis=0)
    return shifts, np.asarray(left)


def _by_shift(pairing: Pairing, grid: FloatArray, recorded: FloatArray) -> FloatArray:
    """Return the unexplained part of one column at every shift, (len(grid) + len(recorded) - 1,)."""
    tamed, computed = tame(pairing.measured), pairing.computed.at(grid)
    there, known = np.isfinite(computed), _known(pairing.time, recorded)
    middle, center = float(np.nanmean(computed)), float(np.mean(tamed))
    first = np.where(there, computed - middle, 0.0)
    second = np.where(known, np.interp(recorded, pairing.time, tamed) - center, 0.0)
    inside, ones = there.astype(float), known.astype(float)
    count = np.round(_correlated(inside, ones))
    moments = Moments(
        np.maximum(count, 1.0),
        _correlated(first, ones),
        _correlated(inside, second),
        _correlated(first**2, ones),
        _correlated(inside, second**2),
        _correlated(first, second),
        apart=center - middle,
        measured_variance=float(np.var(tamed)),
    )
    needed = max(FEWEST_SAMPLES, FEWEST_COVERED * min(inside.sum(), ones.sum()))
    covered = moments.spreads()[0] / float(np.sum(first**2))
    return np.where(count >= needed, np.clip(covered, 0, 1) * unlikeness(moments, exactness(tamed)), 0.0)


def _known(time: FloatArray, recorded: FloatArray) -> BoolArray:
    """Return which points of a grid lie between consecutive samples."""
    steps = np.diff(time)
    follows = np.append(steps <= LONGEST_STEP * np.median(steps), True)
    before = np.clip(np.searchsorted(time, recorded, side="right") - 1, 0, len(time) - 1)
    return np.asarray((recorded >= time[0]) & (recorded <= time[-1]) & follows[before])


def _correlated(first: FloatArray, second: FloatArray) -> FloatArray:
    """Sums of first[i] second[i + shift], for shifts from 1 - len(first) to len(second) - 1."""
    from scipy.fft import irfft, next_fast_len, rfft

    size = next_fast_len(len(first) + len(second) - 1, real=True)
    product = irfft(np.conj(rfft(first, size)) * rfft(second, size), size)
    return np.concatenate([product[size - len(first) + 1 :], product[: len(second)]])


def _refined(
    pairings: Sequence[Pairing], groups: Sequence[object], shift: float, step: float
) -> tuple[float, float, list[Pairing]]:
    """Refine a candidate between the points of the grid.

    Returns:
        The unexplained part, its shift, and the pairings with exchanged columns put right.
    """
    from scipy.optimize import minimize_scalar

    exact = [exactness(tame(each.measured)) for each in pairings]
    thin = [each.thinned() for each in pairings]
    tamed = [tame(each.measured) for each in thin]

    def left(pairs: Sequence[Pairing], candidate: float) -> float:
        return float(np.mean([_left(*each, candidate) for each in zip(pairs, tamed, exact, strict=True)]))

    found = minimize_scalar(
        lambda at: left(thin, at),
        bounds=(shift - 2 * step, shift + 2 * step),
        method="bounded",
        options={"xatol": 1e-3 * step},
    )
    best = float(found.x)
    places = exchanged_places(pairings, groups, best)
    right = [pairings[place].computed for place in places]
    unexplained = left([each._replace(computed=it) for each, it in zip(thin, right, strict=True)], best)
    paired = [each._replace(computed=it) for each, it in zip(pairings, right, strict=True)]
    return unexplained, best, paired


def _left(pairing: Pairing, tamed: FloatArray, exact: float, shift: float) -> float:
    """Return the unexplained part of one column at a shift."""
    moments = moments_of(pairing.overlap(shift)[0], tamed)
    if moments.samples < FEWEST_SAMPLES:
        return 0.0
    covered = float(moments.spreads()[0] / moments.samples) / pairing.computed.spread**2
    return min(1.0, covered) * float(unlikeness(moments, exact))


def _explained(pairing: Pairing, shift: float) -> float:
    """Share of the variance of the measured values that a line explains where both overlap."""
    moments = moments_of(pairing.overlap(shift)[0], tame(pairing.measured))
    computed, measured, product = moments.spreads()
    if moments.samples < FEWEST_SAMPLES or not computed * measured > 0:
        return 0.0
    freedom = (moments.samples - 1) / max(float(moments.samples) - 3, 0.5)
    return float(1 - (1 - product**2 / (computed * measured)) * freedom)


def _agreed(pairings: Sequence[Pairing], shift: float) -> tuple[float, float]:
    """Return the time shift on which the columns agree, and its standard error."""
    error = math.nan
    for _ in range(ROUNDS):
        fits = [fit_line(pairing, shift) for pairing in pairings]
        found = _average([fit for fit in fits if math.isfinite(fit.lag) and fit.correlation**2 >= EXPLAINED])
        if found is None:
            break
        shift, error = shift + found[0], found[1]
    return shift, error


def _average(fits: Sequence[LineFit]) -> tuple[float, float] | None:
    """Weighted mean of the lags of columns that agree, and its standard error; None if there is no column.

    Where lags scatter more than their errors say, all errors are wider by that scatter.
    """
    if not fits:
        return None
    lags, errors = (np.array([getattr(fit, name) for fit in fits]) for name in ("lag", "lag_error"))
    bounded = np.maximum(errors, np.median(errors))
    middle = _weighted_median(lags, 1 / bounded)
    scatter = 1.4826 * _weighted_median(np.abs(lags - middle), 1 / bounded)
    of_middle = 1.25 * float(np.sqrt(1 / np.sum(1 / bounded**2)))
    wide = np.sqrt(errors**2 + max(0.0, scatter**2 - float(np.median(errors)) ** 2) + of_middle**2)
    kept = np.abs(lags - middle) <= APART * wide
    if 2 * np.count_nonzero(kept) <= len(fits):
        kept[:] = True  # where no majority agrees, nobody is wrong
    return _mean_of_effects(lags[kept], errors[kept])


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    order = np.argsort(values)
    sums = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(sums, sums[-1] / 2)])


def _mean_of_effects(values: FloatArray, errors: FloatArray) -> tuple[float, float]:
    """Mean of values that scatter beyond their errors, and its error.

    R. DerSimonian, N. Laird, "Meta-analysis in clinical trials", Controlled Clinical Trials 7 (1986).
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
