"""Problems that prevent the use of recorded samples."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.texts import counted
from vsacli.base.units import time_text
from vsacli.trajectory.curves.closed_form import LONGEST, SHORTEST
from vsacli.trajectory.recorded.disorder import find_disorder
from vsacli.trajectory.recorded.samples import SignalSamples

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
    elif len(time) > 1 and not SHORTEST <= time[-1] - time[0] <= LONGEST:
        yield SampleProblem(
            "time", f"must go on for {SHORTEST:g} to {LONGEST:g} s, not {time[-1] - time[0]:g} s"
        )


def sample_problems(records: Sequence[SignalSamples]) -> Iterator[SampleProblem]:
    """Yield the problems of recorded signals: too few samples, once for all signals, and of their values."""
    most = max(records, key=lambda each: each.signal.spline_degree, default=None)
    if most is not None and len(most.time) <= (degree := most.signal.spline_degree):
        count = counted(len(most.time), "sample")
        yield SampleProblem(most.signal.names[0], f"has {count}; a trajectory needs at least {degree + 1}")
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
            small = ~(np.isfinite(row) & (np.abs(row) > LARGEST_VALUE))
            yield from _requirement_problem(
                column, joint, stamps, row, small, f"at most {LARGEST_VALUE:g} in size"
            )
    if signal.positive:
        for joint, row in zip(components, samples.values[components], strict=True):
            yield from _requirement_problem(name, joint, stamps, row, ~(row <= 0), "positive")


def _requirement_problem(
    quantity: str, joint: int, time: FloatArray, row: FloatArray, holds: BoolArray, requirement: str
) -> Iterator[SampleProblem]:
    """Yield a problem with the first sample that violates a requirement, and the number of such samples."""
    if holds.all():
        return
    first, count = int(np.argmin(holds)), len(holds) - int(np.count_nonzero(holds))
    message = f"must be {requirement}, not {row[first]:g} (t = {time_text(float(time[first]))}"
    message += ")" if count == 1 else f"; {count} such samples)"
    yield SampleProblem(quantity, message, joint, first)
