"""Recovery of even sample times from stamps rounded to decimals, or to floating-point seconds since 1970."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.recorded.thresholds import ENOUGH_ROWS

MOST_DECIMALS = 9

EVEN = 1e-6
"""Deviation from even stamps, in sampling intervals, that affects no derivative."""

LOST = 1.5
"""Interval, in median ones, above which rows are missing."""

DIGITS = 17
"""Digits that distinguish any two floating-point numbers."""

COARSEST = 0.5
"""Coarsest resolution, in sampling intervals, with which stamps show whether samples are even."""


def elapsed_times(stamps: FloatArray) -> FloatArray:
    """Return times from the first stamp on, (samples,), s, made even if their resolution allows it.

    Rounded stamps of even samples act like noise of the motion, even periodic noise, which no fit could
    distinguish from a vibration. Rows may be missing.
    """
    elapsed = stamps - stamps[:1]
    if len(stamps) < ENOUGH_ROWS or not np.all(np.diff(stamps) > 0):
        return elapsed
    even, step = _evenly_spaced(elapsed), float(elapsed[-1]) / (len(stamps) - 1)
    deviation = float(np.abs(even - elapsed).max())
    if deviation <= EVEN * step:
        return elapsed
    digit, rounding = (
        stamp_resolution(stamps),
        _float_spacing(stamps),
    )  # half of each from a stamp, half from both ends
    if deviation <= rounding or (deviation <= digit + rounding and digit <= COARSEST * step):
        return even
    return elapsed


def _evenly_spaced(elapsed: FloatArray) -> FloatArray:
    """Return the nearest multiples of an interval that divides the last time into an integer number."""
    steps = np.diff(elapsed)
    step = float(np.mean(steps[steps < LOST * np.median(steps)]))
    places = np.round(elapsed / (elapsed[-1] / np.round(elapsed[-1] / step)))
    return np.asarray(elapsed[-1] * places / places[-1])


def stamp_resolution(stamps: FloatArray) -> float:
    """Return the resolution of stamps, s: their last decimal, or the spacing of floating-point numbers."""
    few = stamps[:: max(1, len(stamps) // 1000)]
    rounding = _float_spacing(stamps)
    for decimals in range(MOST_DECIMALS + 1):
        if np.abs(few - np.round(few, decimals)).max() <= 2 * rounding:
            return max(10.0**-decimals, rounding)
    return rounding


def _float_spacing(stamps: FloatArray) -> float:
    """Return the spacing of floating-point numbers at the stamps, s."""
    return float(np.spacing(np.abs(stamps).max()))


def even_rate(stamps: FloatArray) -> float | None:
    """Return the sample rate, 1/s, of even stamps, (samples,), s, without missing rows; None for others.

    Of all rates that are possible with the rounding of the stamps it has the fewest digits.
    """
    steps = len(stamps) - 1
    elapsed = elapsed_times(stamps)
    if steps < 1 or np.abs(np.diff(elapsed) * steps / elapsed[-1] - 1).max() > 2 * EVEN:
        return None
    even = elapsed[-1] * np.arange(steps + 1) / steps
    off = float(np.abs(stamps - stamps[0] - even).max()) + _float_spacing(stamps)
    rate, allowed = steps / float(elapsed[-1]), 2 * off / float(elapsed[-1])  # both ends may be off
    rounded = (float(f"{rate:.{digits}g}") for digits in range(1, DIGITS))
    return next((each for each in rounded if abs(each - rate) <= allowed * rate), rate)


def rounding_notes(stamps: FloatArray) -> tuple[str, ...]:
    """Return a note if rounded stamps were replaced by even ones."""
    elapsed = elapsed_times(stamps)
    off = float(np.abs(elapsed - (stamps - stamps[:1])).max(initial=0.0))
    if off == 0:
        return ()
    return (f"stamps are up to {off:.2g} s from even, which is their rounding, and are taken for even",)
