"""Recorded profiles from arrays of samples, with the same checks as for files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import FloatArray, by_joint
from vsacli.base.errors import InputError, Problem
from vsacli.base.signals import Signal
from vsacli.trajectory.fits import METHODS, FitChoice
from vsacli.trajectory.recorded.health import check_health
from vsacli.trajectory.recorded.problems import sample_problems, time_problems
from vsacli.trajectory.recorded.samples import SampledProfile, SignalSamples, rounding_notes
from vsacli.trajectory.times import RecordedTimes


def profiles_of_arrays(
    time: npt.ArrayLike, signal_arrays: Mapping[Signal, Sequence[npt.ArrayLike | None]], fit: str | None
) -> tuple[RecordedTimes, dict[str, SampledProfile], tuple[str, ...]]:
    """Return times, profiles by signal key, and warnings, from arrays of samples.

    Args:
        time: times, (samples,), s.
        signal_arrays: value and derivatives of each signal, (samples, components) each; None if not given.
        fit: method of all fits, see `fit_samples`.

    Raises:
        InputError: `fit` is unknown, or arrays have wrong shapes or values; names each, with the index.
    """
    if fit not in (None, *METHODS):
        raise InputError.one(f"fit must be one of {', '.join(METHODS)}, not {fit!r}")
    times = checked_array("time", time, None)
    records: list[SignalSamples] = []
    for signal, (values, *derivatives) in signal_arrays.items():
        if values is not None:
            records.append(samples_of_arrays(signal, times, values, *derivatives))
        elif any(derivative is not None for derivative in derivatives):
            name = signal.names[0]
            raise InputError.one(f"derivatives of a {name} are given, but not the {name}")
    problems = [*time_problems(times), *sample_problems(records)]
    if problems:
        raise InputError(Problem("", 0, str(problem)) for problem in problems)
    records, faults = check_health(times, records)
    warnings = tuple(map(str, faults))
    profiles = {record.signal.key: SampledProfile.of(record, FitChoice(fit)) for record in records}
    return RecordedTimes(times, rounding_notes(times)), profiles, warnings


def samples_of_arrays(
    signal: Signal, time: FloatArray, values: npt.ArrayLike, *derivatives: npt.ArrayLike | None
) -> SignalSamples:
    """Return samples from arrays of the shape (samples, components).

    Raises:
        InputError: an array is not numeric, or has a wrong shape.
    """
    name, *names = signal.names
    rows = by_joint(checked_array(name, values, len(time), signal.components))
    further = tuple(
        None if array is None else by_joint(checked_array(name, array, len(time), len(rows)))
        for name, array in zip(names, derivatives, strict=True)
    )
    labels = tuple(f"column {index}" for index in range(len(rows)))
    return SignalSamples.recorded(signal, time, rows, further, labels)


def checked_array(name: str, array: npt.ArrayLike, *shape: int | None) -> FloatArray:
    """Return the array as float64; None in the shape stands for any length.

    Raises:
        InputError: the array is not numeric, or has a wrong shape.
    """
    try:
        numbers = np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError.one(f"{name} must be an array of numbers: {error}") from None
    if numbers.ndim != len(shape) or any(
        n not in (None, m) for n, m in zip(shape, numbers.shape, strict=True)
    ):
        expected = ", ".join("any" if length is None else str(length) for length in shape)
        raise InputError.one(f"{name} has the shape {numbers.shape}, expected ({expected})")
    return numbers
