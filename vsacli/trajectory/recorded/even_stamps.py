"""Stamps of even samples that were rounded: to decimals, or to floating-point numbers since 1970."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.recorded.thresholds import ENOUGH_ROWS

MOST_DECIMALS = 9

EVEN = 1e-6
"""Deviations from even stamps, in steps, that matter to no derivative."""

LOST = 1.5
"""Steps, in median ones, over which rows are missing."""

DIGITS = 17
"""Digits that tell any two floating-point numbers apart."""

COARSEST = 0.5
"""Resolution, in steps, up to which stamps show whether samples are even."""


def elapsed_times(stamps: FloatArray) -> FloatArray:
    """Times from the first of some stamps on, (samples,) in s, as even as their resolution admits.

    Rounded stamps of even samples are noise of the motion, a periodic one even, which no fit could tell from
    a vibration. Rows may be missing.
    """
    elapsed = stamps - stamps[:1]
    if len(stamps) < ENOUGH_ROWS or not np.all(np.diff(stamps) > 0):
        return elapsed
    even, step = _even(elapsed), float(elapsed[-1]) / (len(stamps) - 1)
    deviation = float(np.abs(even - elapsed).max())
    if deviation <= EVEN * step:
        return elapsed
    digit, rounding = resolution(stamps), _rounding(stamps)  # half of each by a stamp, half by both ends
    if deviation <= rounding or (deviation <= digit + rounding and digit <= COARSEST * step):
        return even
    return elapsed


def _even(elapsed: FloatArray) -> FloatArray:
    """Return the nearest multiples of a step that is the last time over a whole number."""
    steps = np.diff(elapsed)
    step = float(np.mean(steps[steps < LOST * np.median(steps)]))
    places = np.round(elapsed / (elapsed[-1] / np.round(elapsed[-1] / step)))
    return np.asarray(elapsed[-1] * places / places[-1])


def resolution(stamps: FloatArray) -> float:
    """Return the last digit of stamps, s: of their decimals, or of their floating-point numbers."""
    few = stamps[:: max(1, len(stamps) // 1000)]
    rounding = _rounding(stamps)
    for decimals in range(MOST_DECIMALS + 1):
        if np.abs(few - np.round(few, decimals)).max() <= 2 * rounding:
            return max(10.0**-decimals, rounding)
    return rounding


def _rounding(stamps: FloatArray) -> float:
    """Distance of the floating-point numbers that stamps are, s."""
    return float(np.spacing(np.abs(stamps).max()))


def even_rate(stamps: FloatArray) -> float | None:
    """Return the samples per second of even stamps that miss none, (samples,) in s; None of others.

    Of all rates that the rounding of the stamps admits it is the one of fewest digits.
    """
    steps = len(stamps) - 1
    elapsed = elapsed_times(stamps)
    if steps < 1 or np.abs(np.diff(elapsed) * steps / elapsed[-1] - 1).max() > 2 * EVEN:
        return None
    even = elapsed[-1] * np.arange(steps + 1) / steps
    off = float(np.abs(stamps - stamps[0] - even).max()) + _rounding(stamps)
    rate, allowed = steps / float(elapsed[-1]), 2 * off / float(elapsed[-1])  # off at either end
    rounded = (float(f"{rate:.{digits}g}") for digits in range(1, DIGITS))
    return next((each for each in rounded if abs(each - rate) <= allowed * rate), rate)


def rounding_notes(stamps: FloatArray) -> tuple[str, ...]:
    """Return the note that rounded stamps were taken for even ones, if they were."""
    elapsed = elapsed_times(stamps)
    off = float(np.abs(elapsed - (stamps - stamps[:1])).max(initial=0.0))
    if off == 0:
        return ()
    return (f"stamps are up to {off:.2g} s from even, which is their rounding, and are taken for even",)
