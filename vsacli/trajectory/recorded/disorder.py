"""Stamps that do not increase: the pattern by which they fail, and the remedy.

The rows of a log are nearly always in the order of the motion. Sorting them by wrong stamps would scramble
the motion, and deleting rows with equal stamps would thin it, so that neither is ever advised.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.texts import counted

TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of 32-bit counters, s."""

WRAP_STEPS, WRAP_SHARE = 20.0, 0.05
"""Largest deviation of a fall from 2**32 ticks, in median intervals, as rows may be missing where it wraps;
and as a share of it."""

RESTART_SHARE = 0.5
"""Smallest fall that is a restart, as a share of the time since the last one; a late stamp falls by less."""

MOST_RESTARTS = 0.01
"""Largest share of rows at which a recording begins again."""

REPEATED_SHARE = 0.3
"""Smallest share of repeated stamps, after the first one, that have too few digits or come in bursts."""

GRAIN = 0.2
"""Largest deviation of steps between such stamps from multiples of the smallest one, in smallest steps."""

ENOUGH_STEPS = 20
"""Fewest intervals that give the rate of the rows."""

SAME_RATE = 0.05
"""Largest relative difference of a stated rate from that of the rows, if it stands in place of the stamps; a
trajectory that is to be resampled may have any other."""


class Disorder(NamedTuple):
    """A failure of stamps to increase.

    Attributes:
        sample: index of the first sample that is not later than the one before it.
        cause: pattern of the failure, a clause.
        remedy: advice, a clause.
        rate: rate of the rows, 1/s; None if it is unknown, or does not help.
    """

    sample: int
    cause: str
    remedy: str
    rate: float | None = None

    @property
    def message(self) -> str:
        """The problem of the stamps, a sentence without its subject."""
        return f"must increase, but {self.cause}; {self.remedy}"

    def is_replaced_by(self, rate: float | None) -> bool:
        """Return whether a stated rate, 1/s, is that of the rows, so that the stamps are not needed."""
        return rate is not None and self.rate is not None and abs(rate / self.rate - 1) <= SAME_RATE


def find_disorder(stamps: FloatArray) -> Disorder | None:
    """Return the failure of stamps, (samples,), s, to increase; None if they do, or are not finite."""
    steps = np.diff(stamps) if np.isfinite(stamps).all() else np.ones(1)
    if np.all(steps > 0):
        return None
    return next(filter(None, _patterns(stamps, steps)))


def _patterns(stamps: FloatArray, steps: FloatArray) -> Iterator[Disorder | None]:
    failures = np.flatnonzero(~(steps > 0))
    usual = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    if np.all(steps[failures] < 0):
        yield _wrap(stamps, steps, usual)
        yield _restart(stamps, steps, failures)
    elif np.all(steps[failures] == 0):
        yield _repeats(stamps, steps, int(failures[0]))
    first = int(failures[0]) + 1
    before, after = (f"{value:.9g} s" for value in stamps[first - 1 : first + 1].tolist())
    cause = f"{before} appears twice" if before == after else f"{after} follows {before}"
    cause += f" ({len(failures)} such rows)" if len(failures) > 1 else ""
    rate = rounded_rate(1 / usual) if usual > 0 else None
    shown = "HZ" if rate is None else f"{rate:g}"
    remedy = f"correct these stamps, or set rate: {shown} in their place if the rows are equally spaced"
    yield Disorder(first, cause, remedy, rate)


def _wrap(stamps: FloatArray, steps: FloatArray, usual: float) -> Disorder | None:
    """Return that a 32-bit counter begins again, if every fall is of its size."""
    falls = steps < 0
    for unit, size in TICKS.items():
        whole = 2.0**32 * size
        if np.all(np.abs(steps[falls] + whole) <= min(WRAP_STEPS * usual, WRAP_SHARE * whole)):
            rate = rounded_rate(len(steps) / float(steps.sum() + whole * falls.sum()))
            first = int(np.argmax(falls)) + 1
            cause = f"falls by 2**32 {unit} after {stamps[first - 1]:.9g} s, as a 32-bit counter that wraps"
            remedy = f"set rate: {rate:g} in place of the stamps, or add {whole:.10g} s from this row on"
            return Disorder(first, cause, remedy, rate)
    return None


def _restart(stamps: FloatArray, steps: FloatArray, failures: FloatArray) -> Disorder | None:
    """Return that the recording begins again, if stamps fall rarely, and by about their whole range."""
    starts = np.append(0, failures[:-1] + 1)
    ranges = stamps[failures] - stamps[starts]
    far = np.all(-steps[failures] >= RESTART_SHARE * ranges) and np.all(failures - starts >= ENOUGH_STEPS)
    if not far or len(failures) > max(1, MOST_RESTARTS * len(steps)):
        return None
    first = int(failures[0]) + 1
    times = "" if len(failures) == 1 else f", and {counted(len(failures) - 1, 'time')} more"
    cause = f"{stamps[first]:.9g} s follows {stamps[first - 1]:.9g} s{times}: the recording begins again"
    return Disorder(first, f"{cause}, as in a bag played in a loop", "cut the file in two before this row")


def _repeats(stamps: FloatArray, steps: FloatArray, start: int) -> Disorder | None:
    """Return that stamps have too few digits, if many repeat and the others are multiples of one step."""
    coarse = steps[start:]
    repeated, rises = int(np.count_nonzero(coarse == 0)), coarse[coarse > 0]
    if not rises.size or repeated < REPEATED_SHARE * len(coarse):
        return None
    grain = float(rises.min())
    if np.any(np.abs(rises / grain - np.round(rises / grain)) > GRAIN):
        return None
    last = int(np.flatnonzero(steps > 0)[-1]) + 1  # first row with the last stamp
    fine = steps[: max(0, start - 1)]
    mean = float(fine.mean()) if len(fine) >= ENOUGH_STEPS else float(stamps[last] - stamps[0]) / last
    rate = rounded_rate(1 / mean)
    cause = (
        f"{counted(repeated, 'row')} from {stamps[start]:.9g} s on repeat the stamp before: stamps with too"
        f" few digits, in steps of {grain:.3g} s"
    )
    return Disorder(
        start + 1, cause, f"the rows are in order: set rate: {rate:g} in place of the stamps", rate
    )


def rounded_rate(rate: float) -> float:
    """Return a rate, 1/s, with the three digits that stamps determine."""
    return float(f"{rate:.3g}")
