"""When in a recording the computed motion begins: the shift at which measured signals follow computed ones.

Clocks of a laboratory start before the motion, and a recording may end before it or be cut out of its middle.
At first the measured values are taken as they are, and the shift is that of the smallest mean square error.
If no shift will do, they are compared by the straight line through them, so that wrong offsets, units and
gains do not matter, and at last by a falling one: a sensor may be mounted the other way round, but half a
period of a vibration looks alike. Since a line fits many a piece of a smooth motion, what lies outside the
recording then counts as not explained.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray

MOST_POINTS = 200_000
"""Points of the grid on which the shift is looked for first; the computed signal is known between them."""

EXPLAINED = 0.5
"""Share of the variance of the computed signals that the best shift must explain."""

FEWEST_COVERED = 0.5
"""Share of the result, or of the recording if that is shorter, over which both must overlap."""

COVERAGE_WEIGHT = 1e-4
"""Of two shifts that explain as much, the one by which the recording covers more is taken."""

AS_GOOD = 0.99
"""Share of the best explanation from which on another shift is as good."""

ROUNDING = 1e-6
"""Share of the variance of a recording below which sums of transforms are but rounding."""

FEWEST_SAMPLES = 4
"""Samples by which two signals can be told to be alike."""

OWN_WIDTH = 0.05
"""Share of the duration around a shift that belongs to the same maximum."""


class Pairing(NamedTuple):
    """A computed signal and what was measured of it.

    Attributes:
        computed: values at times from the beginning of the result, (samples,), NaN outside.
        duration: of the result, s.
        time: of the measured values, s, ascending.
        measured: (samples,).
    """

    computed: Callable[[FloatArray], FloatArray]
    duration: float
    time: FloatArray
    measured: FloatArray


class Alignment(NamedTuple):
    """Where the result begins in the recording.

    Attributes:
        begins_at: time of the recording, s, at which the result begins; negative if that is before it.
        explained: share of the variance of the computed signals that the measured ones explain there.
        others: further times that explain nearly as much, as in periodic motions.
    """

    begins_at: float
    explained: float
    others: tuple[float, ...] = ()


class Way(enum.Enum):
    """How measured values are held against computed ones."""

    AS_THEY_ARE = enum.auto()
    BY_A_RISING_LINE = enum.auto()
    BY_ANY_LINE = enum.auto()


@np.errstate(all="ignore")  # numbers too large, or too few, explain nothing
def align(pairings: Sequence[Pairing]) -> Alignment | None:
    """The shift that explains most; None if there is none that explains half, or nothing moves."""
    moving = [pairing for pairing in pairings if _moves(pairing)]
    for way in Way if moving else ():
        found = _search(moving, way)
        if found is not None and found.explained >= EXPLAINED:
            return found
    return None


def _search(pairings: Sequence[Pairing], way: Way) -> Alignment | None:
    step = _step(pairings[0])
    shifts, explained = _on_grid(pairings, step, way)
    best = int(np.argmax(explained))
    if not explained[best] > 0:
        return None
    apart = np.abs(shifts - shifts[best]) > OWN_WIDTH * pairings[0].duration
    peaks = (explained > np.roll(explained, 1)) & (explained >= np.roll(explained, -1))
    others = shifts[peaks & apart & (explained >= AS_GOOD * explained[best])]
    shift, of_covered = _refined(pairings, float(shifts[best]), step, way)
    share = of_covered if way is Way.AS_THEY_ARE else float(explained[best])
    return Alignment(shift, share, tuple(others.tolist()))


def _moves(pairing: Pairing) -> bool:
    values = pairing.computed(np.linspace(0.0, pairing.duration, 1000))
    return bool(np.nanstd(values) > 0 and np.std(pairing.measured) > 0)


def _step(pairing: Pairing) -> float:
    """Of the grid: that of the recording, unless it is finer than the grid has points."""
    span = pairing.duration + float(pairing.time[-1])
    return max(float(np.median(np.diff(pairing.time))), span / MOST_POINTS)


def _on_grid(pairings: Sequence[Pairing], step: float, way: Way) -> tuple[FloatArray, FloatArray]:
    """Shifts, and what each explains of the signals, the mean of the shares of their variances."""
    grid = np.arange(0.0, pairings[0].duration + step / 2, step)
    recorded = np.arange(0.0, float(pairings[0].time[-1]) + step / 2, step)
    shifts = step * np.arange(1 - len(grid), len(recorded), dtype=float)
    explained = [
        _by_shift(pairing.computed(grid), np.interp(recorded, pairing.time, pairing.measured), way)
        for pairing in pairings
    ]
    return shifts, np.asarray(np.mean(explained, axis=0))


def _by_shift(computed: FloatArray, measured: FloatArray, way: Way) -> FloatArray:
    """Share of the variance of the computed values that measured ones explain.

    For every shift at which both overlap, (len(computed) + len(measured) - 1,).
    """
    there = np.isfinite(computed).astype(float)
    middle = float(np.nanmean(computed))
    computed, measured = np.where(there > 0, computed - middle, 0.0), measured - middle
    total = float(np.sum(computed**2))
    ones = np.ones_like(measured)
    count = np.maximum(np.round(_correlated(there, ones)), 1.0)
    both, squared = _correlated(computed, measured), _correlated(there, measured**2)
    if way is Way.AS_THEY_ARE:
        covered = count / there.sum()
        error = (_correlated(computed**2, ones) - 2 * both + squared) / count
        share = 1 - error * there.sum() / total + COVERAGE_WEIGHT * covered
        return np.where(covered >= FEWEST_COVERED * min(1.0, len(measured) / len(computed)), share, -np.inf)
    mean = _correlated(there, measured) / count
    together = both - _correlated(computed, ones) * mean
    spread = squared - count * mean * mean
    flat = spread <= ROUNDING * count * float(np.var(measured))
    along = together if way is Way.BY_ANY_LINE else np.maximum(together, 0.0)
    return np.where(flat, 0.0, along * along / np.where(flat, 1.0, spread)) / total


def _correlated(first: FloatArray, second: FloatArray) -> FloatArray:
    """Sums of first[i] second[i + shift], for shifts from 1 - len(first) to len(second) - 1."""
    from scipy.fft import irfft, next_fast_len, rfft

    size = next_fast_len(len(first) + len(second) - 1, real=True)
    product = irfft(np.conj(rfft(first, size)) * rfft(second, size), size)
    return np.concatenate([product[size - len(first) + 1 :], product[: len(second)]])


def _refined(pairings: Sequence[Pairing], shift: float, step: float, way: Way) -> tuple[float, float]:
    """The shift between the points of the grid, and what it explains of what the recording covers."""
    from scipy.optimize import minimize_scalar

    def unexplained(candidate: float) -> float:
        return -float(np.mean([_explained(pairing, candidate, way) for pairing in pairings]))

    bounds = (shift - 2 * step, shift + 2 * step)
    found = minimize_scalar(unexplained, bounds=bounds, method="bounded", options={"xatol": 1e-4 * step})
    return float(found.x), -float(found.fun)


def _explained(pairing: Pairing, shift: float, way: Way) -> float:
    """Share of the variance of the computed values that is explained where both overlap."""
    computed = pairing.computed(pairing.time - shift)
    both = np.isfinite(computed)
    computed, measured = computed[both], pairing.measured[both]
    if both.sum() < FEWEST_SAMPLES or np.std(computed) == 0 or np.std(measured) == 0:
        return 0.0
    if way is Way.AS_THEY_ARE:
        return max(0.0, 1.0 - float(np.mean((measured - computed) ** 2) / np.var(computed)))
    coefficient = float(np.corrcoef(computed, measured)[0, 1])
    return coefficient**2 if way is Way.BY_ANY_LINE else max(coefficient, 0.0) ** 2


@np.errstate(all="ignore")  # where it is infinite or no number, as of too few samples, no lag explains it
def lag_of(pairing: Pairing, begins_at: float, within: float) -> float:
    """How much later than the alignment a measured signal follows, s.

    NaN if no shift up to `within` explains half of what is not explained without, noise from sample to sample
    apart: the signal disagrees otherwise, or by no more than its noise.
    """
    from scipy.optimize import minimize_scalar

    def smooth_rest(lag: float) -> float:
        return _rest(pairing, begins_at + lag)[0]

    bounds = (-within, within)
    found = minimize_scalar(smooth_rest, bounds=bounds, method="bounded", options={"xatol": 1e-4 * within})
    smooth, noise = _rest(pairing, begins_at)
    explained = noise < smooth and found.fun <= (1 - EXPLAINED) * smooth
    return float(found.x) if explained else math.nan


def _rest(pairing: Pairing, shift: float) -> tuple[float, float]:
    """Variance of what the line through the measured values leaves, without that of its white noise.

    The second number is what that noise alone could make of the first.
    """
    computed = pairing.computed(pairing.time - shift)
    both = np.isfinite(computed)
    computed, measured = computed[both], pairing.measured[both]
    if both.sum() < FEWEST_SAMPLES or np.std(computed) == 0:
        return math.inf, 0.0
    rest = measured - np.polyval(np.polyfit(computed, measured, 1), computed)
    white = float(np.mean(np.diff(rest) ** 2) / 2)
    return max(0.0, float(np.var(rest)) - white), 4 * white / math.sqrt(len(rest))
