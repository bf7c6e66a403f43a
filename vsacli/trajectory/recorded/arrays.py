"""Samples from arrays, and what keeps samples from being used."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import BoolArray, FloatArray, by_joint
from vsacli.base.errors import InputError, Problem
from vsacli.base.signals import Signal
from vsacli.base.units import time_text
from vsacli.trajectory.curves.closed_form import LONGEST, SHORTEST
from vsacli.trajectory.fits import METHODS
from vsacli.trajectory.recorded.samples import SampledProfile, Samples
from vsacli.trajectory.times import RecordedTimes

LARGEST_VALUE = 1e100
"""Values beyond are no motion of a robot, and their squares, which a fit takes, would overflow."""


def profiles_of_arrays(
    time: npt.ArrayLike, given: Mapping[Signal, Sequence[npt.ArrayLike | None]], fit: str | None
) -> tuple[RecordedTimes, dict[str, SampledProfile]]:
    """Times and profiles, by the keys of their signals, from arrays of samples.

    Args:
        time: (samples,), s.
        given: of each signal value and derivatives, (samples, components) each, None where there is none.
        fit: the method of all fits, as in `fit_samples`.

    Raises:
        InputError: `fit` is no method; or naming each array that does not fit, by index.
    """
    if fit not in (None, *METHODS):
        raise InputError.one(f"fit must be one of {', '.join(METHODS)}, not {fit!r}")
    times = checked_array("time", time, None)
    records = [record for signal, arrays in given.items() for record in _recorded(signal, times, *arrays)]
    problems = [*time_problems(times), *(found for record in records for found in value_problems(record))]
    if problems:
        raise InputError(Problem("", 0, str(problem)) for problem in problems)
    return RecordedTimes(times), {record.signal.key: SampledProfile.of(record, fit) for record in records}


def _recorded(
    signal: Signal, times: FloatArray, values: npt.ArrayLike | None, *derivatives: npt.ArrayLike | None
) -> Iterator[Samples]:
    """The samples of a signal, if there are any."""
    if values is not None:
        yield samples_of_arrays(signal, times, values, *derivatives)
    elif any(given is not None for given in derivatives):
        name = signal.names[0]
        raise InputError.one(f"derivatives of a {name} are given, but not the {name}")


def samples_of_arrays(
    signal: Signal, time: FloatArray, values: npt.ArrayLike, *derivatives: npt.ArrayLike | None
) -> Samples:
    """Samples from arrays of the shape (samples, components).

    Raises:
        InputError: an array holds something else than numbers, or has another shape.
    """
    name, *names = signal.names
    rows = by_joint(checked_array(name, values, len(time), signal.components))
    further = tuple(
        None if array is None else by_joint(checked_array(name, array, len(time), len(rows)))
        for name, array in zip(names, derivatives, strict=True)
    )
    labels = tuple(f"column {index}" for index in range(len(rows)))
    return Samples.recorded(signal, time, rows, further, labels)


def checked_array(name: str, array: npt.ArrayLike, *shape: int | None) -> FloatArray:
    """The array as float64; None in the shape stands for any length.

    Raises:
        InputError: the array holds something else than numbers, or has another shape.
    """
    try:
        found = np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError.one(f"{name} must be an array of numbers: {error}") from None
    if found.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, found.shape, strict=True)):
        expected = ", ".join("any" if length is None else str(length) for length in shape)
        raise InputError.one(f"{name} has the shape {found.shape}, expected ({expected})")
    return found


@dataclass(frozen=True)
class SampleProblem:
    """Something wrong with recorded samples: first at the index `sample` (None: concerns all)."""

    quantity: str
    message: str
    joint: int | None = None
    sample: int | None = None

    def __str__(self) -> str:
        index = ", ".join(str(number) for number in (self.sample, self.joint) if number is not None)
        return f"{self.quantity}[{index}] {self.message}" if index else f"{self.quantity} {self.message}"


def time_problems(time: FloatArray) -> Iterator[SampleProblem]:
    """What keeps these times, (samples,) in s, from being those of a trajectory: at most one problem."""
    finite, rising = np.isfinite(time), time[1:] > time[:-1]
    if not finite.all():
        sample = int(np.argmin(finite))
        yield SampleProblem("time", f"must be finite, not {time[sample]}", sample=sample)
    elif not rising.all():
        sample = int(np.argmin(rising)) + 1
        message = f"must increase strictly, but {time[sample]} s follows {time[sample - 1]} s"
        yield SampleProblem("time", message, sample=sample)
    elif len(time) > 1 and not SHORTEST <= time[-1] - time[0] <= LONGEST:
        yield SampleProblem(
            "time", f"must go on for {SHORTEST:g} to {LONGEST:g} s, not {time[-1] - time[0]:g} s"
        )


def value_problems(samples: Samples) -> Iterator[SampleProblem]:
    """What keeps these values from being used: too few, or not finite, or not positive where they must be."""
    signal, degree = samples.signal, samples.signal.spline_degree
    name, count = signal.names[0], len(samples.time)
    if count <= degree:
        yield SampleProblem(
            name, f"needs at least {degree + 1} samples for a C{degree - 1} spline, not {count}"
        )
    given, stamps = np.flatnonzero(samples.given).tolist(), samples.start + samples.time
    for column, rows in zip(signal.names, (samples.values, *samples.derivatives), strict=True):
        for joint, row in () if rows is None else zip(given, rows[given], strict=True):
            yield from _breach(column, joint, stamps, row, np.isfinite(row), "finite")
            small = ~(np.isfinite(row) & (np.abs(row) > LARGEST_VALUE))
            yield from _breach(column, joint, stamps, row, small, f"at most {LARGEST_VALUE:g} in size")
    if signal.positive:
        for joint, row in zip(given, samples.values[given], strict=True):
            yield from _breach(name, joint, stamps, row, ~(row <= 0), "positive")


def _breach(
    quantity: str, joint: int, time: FloatArray, row: FloatArray, holds: BoolArray, requirement: str
) -> Iterator[SampleProblem]:
    """The first sample at which a requirement does not hold, and how many there are."""
    if holds.all():
        return
    first, count = int(np.argmin(holds)), len(holds) - int(np.count_nonzero(holds))
    message = f"must be {requirement}, not {row[first]:g} (t = {time_text(float(time[first]))}"
    message += ")" if count == 1 else f"; {count} such samples)"
    yield SampleProblem(quantity, message, joint, first)
