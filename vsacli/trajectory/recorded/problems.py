"""Problems that prevent the use of recorded samples, such as stamps that do not increase.

The rows of a log are nearly always in the order of the motion. Sorting them by wrong stamps would scramble
the motion, and deleting rows with equal stamps would thin it, so that neither is ever advised.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.texts import counted
from vsacli.base.units import time_text
from vsacli.trajectory.curves.closed_form import MAX_DURATION, MIN_DURATION
from vsacli.trajectory.recorded.samples import SignalSamples

TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # units of 32-bit counters, s
WRAP_STEPS = 20.0  # rows may be missing where a counter wraps
RESTART_SHARE = 0.5  # of the time since the last start; a late stamp falls by less
REPEATED_SHARE = 0.3  # of the rows after the first repeated stamp, if stamps have too few digits
ENOUGH_STEPS = 20  # intervals that give a rate
SAME_RATE = 0.05  # a rate farther from that of the rows is for resampling, not in place of stamps


class Disorder(NamedTuple):
    """A failure of stamps to increase.

    Attributes:
        sample: index of the first sample that is not later than the one before it.
        cause: pattern of the failure, a clause.
        advice: advice, a clause.
        rate: rate of the rows, 1/s; NaN if it is unknown, None if no rate helps.
    """

    sample: int
    cause: str
    advice: str
    rate: float | None = None

    @property
    def message(self) -> str:
        """The problem of the stamps, a sentence without its subject."""
        return f"must increase, but {self.cause}; {self.advice}"

    def is_replaced_by(self, rate: float | None) -> bool:
        """Return whether a stated rate, 1/s, is that of the rows, so that the stamps are not needed."""
        return rate is not None and self.rate is not None and not abs(rate / self.rate - 1) > SAME_RATE


def find_disorder(stamps: FloatArray) -> Disorder | None:
    """Return the failure of stamps, (samples,), s, to increase; None if they do, or are not finite."""
    steps = np.diff(stamps) if np.isfinite(stamps).all() else np.ones(1)
    if np.all(steps > 0):
        return None
    return next(filter(None, _possible_disorders(stamps, steps)))


def replace_stamps(stamps: FloatArray, rate: float | None) -> tuple[FloatArray, Disorder | None]:
    """Return the times by a stated rate, 1/s, and why they replace the stamps, s; else these and None."""
    disorder = find_disorder(stamps)
    if rate is None or disorder is None or not disorder.is_replaced_by(rate):
        return stamps, None
    return np.arange(len(stamps)) / rate, disorder


def _possible_disorders(stamps: FloatArray, steps: FloatArray) -> Iterator[Disorder | None]:
    failures = np.flatnonzero(~(steps > 0))
    median_step = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    if np.all(steps[failures] < 0):
        yield _counter_wrap(stamps, steps, median_step)
        yield _recording_restart(stamps, steps, failures)
    elif np.all(steps[failures] == 0):
        yield _repeated_stamps(stamps, steps, int(failures[0]))
    first_failure = int(failures[0]) + 1
    previous_text, next_text = (
        f"{value:.9g} s" for value in stamps[first_failure - 1 : first_failure + 1].tolist()
    )
    cause = (
        f"{previous_text} appears twice"
        if previous_text == next_text
        else f"{next_text} follows {previous_text}"
    )
    cause += f" ({len(failures)} such rows)" if len(failures) > 1 else ""
    rate = rounded_rate(1 / median_step) if median_step > 0 else math.nan
    advice = f"correct these stamps, or set {_rate_text(rate)} in their place if the rows are equally spaced"
    yield Disorder(first_failure, cause, advice, rate)


def _counter_wrap(stamps: FloatArray, steps: FloatArray, median_step: float) -> Disorder | None:
    """Return that a 32-bit counter begins again, if every fall is of its size."""
    is_falling = steps < 0
    for unit, size in TICKS.items():
        counter_range = 2.0**32 * size
        if np.all(
            np.abs(steps[is_falling] + counter_range) <= min(WRAP_STEPS * median_step, 0.05 * counter_range)
        ):
            rate = rounded_rate(len(steps) / float(steps.sum() + counter_range * is_falling.sum()))
            first_fall = int(np.argmax(is_falling)) + 1
            cause = (
                f"falls by 2**32 {unit} after {stamps[first_fall - 1]:.9g} s, as a 32-bit counter that wraps"
            )
            advice = (
                f"set rate: {rate:g} in place of the stamps, or add {counter_range:.10g} s from this row on"
            )
            return Disorder(first_fall, cause, advice, rate)
    return None


def _recording_restart(stamps: FloatArray, steps: FloatArray, failures: IndexArray) -> Disorder | None:
    """Return that the recording begins again, if stamps fall rarely, and by about their whole range."""
    starts = np.append(0, failures[:-1] + 1)
    ranges = stamps[failures] - stamps[starts]
    is_restart = np.all(-steps[failures] >= RESTART_SHARE * ranges) and np.all(
        failures - starts >= ENOUGH_STEPS
    )
    if not is_restart:
        return None
    first_failure = int(failures[0]) + 1
    count_text = "" if len(failures) == 1 else f", and {counted(len(failures) - 1, 'time')} more"
    cause = (
        f"{stamps[first_failure]:.9g} s follows {stamps[first_failure - 1]:.9g} s{count_text}: the "
        "recording begins again"
    )
    return Disorder(
        first_failure, f"{cause}, as in a bag played in a loop", "cut the file in two before this row"
    )


def _repeated_stamps(stamps: FloatArray, steps: FloatArray, start: int) -> Disorder | None:
    """Return that stamps have too few digits, if many repeat and the others are multiples of one step."""
    later_steps = steps[start:]
    repeated_count, rises = int(np.count_nonzero(later_steps == 0)), later_steps[later_steps > 0]
    if not rises.size or repeated_count < REPEATED_SHARE * len(later_steps):
        return None
    stamp_step = float(rises.min())
    if np.any(np.abs(rises / stamp_step - np.round(rises / stamp_step)) > 0.2):  # no multiples of one step
        return None
    first, last = (np.flatnonzero(steps > 0)[[0, -1]] + 1).tolist()  # rows where a stamp begins
    earlier_steps = steps[: max(0, start - 1)]
    rate_steps = earlier_steps if len(earlier_steps) >= ENOUGH_STEPS else steps[first:last]
    rate = rounded_rate(len(rate_steps) / float(rate_steps.sum())) if len(rate_steps) else math.nan
    cause = (
        f"{counted(repeated_count, 'row')} from {stamps[start]:.9g} s on repeat the stamp before: "
        "stamps with too"
        f" few digits, in steps of {stamp_step:.3g} s"
    )
    advice = f"the rows are in order: set {_rate_text(rate)} in place of the stamps"
    return Disorder(start + 1, cause, advice, rate)


def _rate_text(rate: float) -> str:
    return "rate: (Hz), that of the rows," if math.isnan(rate) else f"rate: {rate:g}"


def rounded_rate(rate: float) -> float:
    """Return a rate, 1/s, with the fewest digits that it needs; with four if these do not suffice."""
    rounded_rates = [float(f"{rate:.{digits}g}") for digits in (3, 4, 5, 6)]
    return next((each for each in rounded_rates if abs(each - rate) <= 1e-5 * rate), rounded_rates[1])


LARGEST_VALUE = 1e100
"""Largest value; larger ones are no motion of a robot, and their squares, which fits need, may overflow."""


@dataclass(frozen=True)
class SampleProblem:
    """A problem of recorded samples, at first at the index `sample`; None if it concerns all."""

    quantity: str
    message: str
    joint: int | None = None
    sample: int | None = None

    def __str__(self) -> str:
        index = ", ".join(str(number) for number in (self.sample, self.joint) if number is not None)
        return f"{self.quantity}[{index}] {self.message}" if index else f"{self.quantity} {self.message}"


def time_problems(time: FloatArray) -> Iterator[SampleProblem]:
    """Yield the first problem of times, (samples,), s, if any."""
    finite = np.isfinite(time)
    if not finite.all():
        sample = int(np.argmin(finite))
        yield SampleProblem("time", f"must be finite, not {time[sample]}", sample=sample)
    elif (disorder := find_disorder(time)) is not None:
        yield SampleProblem("time", disorder.message, sample=disorder.sample)
    elif len(time) > 1 and not MIN_DURATION <= time[-1] - time[0] <= MAX_DURATION:
        yield SampleProblem(
            "time", f"must go on for {MIN_DURATION:g} to {MAX_DURATION:g} s, not {time[-1] - time[0]:g} s"
        )


def sample_problems(records: Sequence[SignalSamples]) -> Iterator[SampleProblem]:
    """Yield the problems of recorded signals: too few samples, once for all signals, and of their values."""
    most_demanding = max(records, key=lambda each: each.signal.spline_degree, default=None)
    if most_demanding is not None and len(most_demanding.time) <= (
        degree := most_demanding.signal.spline_degree
    ):
        count = counted(len(most_demanding.time), "sample")
        yield SampleProblem(
            most_demanding.signal.names[0], f"has {count}; a trajectory needs at least {degree + 1}"
        )
    for record in records:
        yield from _value_problems(record)


def _value_problems(samples: SignalSamples) -> Iterator[SampleProblem]:
    """Yield the problems of values: not finite, too large, or not positive where required."""
    signal = samples.signal
    name = signal.names[0]
    components, stamps = np.flatnonzero(samples.has_values).tolist(), samples.start + samples.time
    for column, rows in zip(signal.names, (samples.values, *samples.derivatives), strict=True):
        for joint, row in () if rows is None else zip(components, rows[components], strict=True):
            yield from _requirement_problem(column, joint, stamps, row, np.isfinite(row), "finite")
            is_small = ~(np.isfinite(row) & (np.abs(row) > LARGEST_VALUE))
            yield from _requirement_problem(
                column, joint, stamps, row, is_small, f"at most {LARGEST_VALUE:g} in size"
            )
    if signal.positive:
        for joint, row in zip(components, samples.values[components], strict=True):
            yield from _requirement_problem(name, joint, stamps, row, ~(row <= 0), "positive")


def _requirement_problem(
    quantity: str, joint: int, time: FloatArray, row: FloatArray, is_met: BoolArray, requirement: str
) -> Iterator[SampleProblem]:
    """Yield a problem with the first sample that violates a requirement, and the number of such samples."""
    if is_met.all():
        return
    first_index, count = int(np.argmin(is_met)), len(is_met) - int(np.count_nonzero(is_met))
    message = f"must be {requirement}, not {row[first_index]:g} (t = {time_text(float(time[first_index]))}"
    message += ")" if count == 1 else f"; {count} such samples)"
    yield SampleProblem(quantity, message, joint, first_index)
