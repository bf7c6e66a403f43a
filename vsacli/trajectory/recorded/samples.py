"""Recorded samples of a signal, and the profile they make: given columns, and a fit for the others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import BoolArray, FloatArray, by_joint
from vsacli.base.errors import InputError
from vsacli.base.signals import Signal
from vsacli.trajectory.curves.closed_form import LONGEST, SHORTEST
from vsacli.trajectory.fits import Fit, fit_samples, mismatches
from vsacli.trajectory.fits.fit_text import describe, fit_sentences
from vsacli.trajectory.times import stretch

LARGEST = 1e100
"""Values beyond are no motion of a robot, and their squares, which a fit takes, would overflow."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Samples:
    """A signal at recorded times; `time_problems` and `value_problems` say what keeps it from being used.

    Attributes:
        signal: what is described.
        time: (samples,) in s.
        values: (components, samples); NaN throughout if the signal is optional and a component has none.
        derivatives: for each derivative of the signal the given values, (components, samples), or None.
        labels: what the components are called in sentences.
    """

    signal: Signal
    time: FloatArray = field(repr=False)
    values: FloatArray = field(repr=False)
    derivatives: tuple[FloatArray | None, ...] = field(repr=False)
    labels: tuple[str, ...]

    @classmethod
    def from_arrays(
        cls, signal: Signal, time: FloatArray, values: npt.ArrayLike, *derivatives: npt.ArrayLike | None
    ) -> Samples:
        """From arrays of the shape (samples, components).

        Raises:
            InputError: an array holds something else than numbers, or has another shape.
        """
        name, *names = signal.names
        rows = _checked_rows(name, values, len(time), signal.components)
        further = tuple(
            None if array is None else _checked_rows(name, array, len(time), len(rows))
            for name, array in zip(names, derivatives, strict=True)
        )
        labels = tuple(f"column {index}" for index in range(len(rows)))
        return cls(signal=signal, time=time, values=rows, derivatives=further, labels=labels)

    @property
    def given(self) -> BoolArray:
        """Which components have values, (components,)."""
        absent: BoolArray = np.all(np.isnan(self.values), axis=1)
        return ~absent if self.signal.optional else np.ones_like(absent)

    @property
    def complete(self) -> bool:
        """Whether all derivatives are given."""
        return all(given is not None for given in self.derivatives)

    @property
    def missing(self) -> tuple[str, ...]:
        """The derivatives that are not given."""
        pairs = zip(self.signal.names[1:], self.derivatives, strict=True)
        return tuple(name for name, given in pairs if given is None)

    def warnings(self, fit: Fit, *, resampled: bool) -> Iterator[str]:
        """Which numbers at the steps are estimates, and which given derivatives do not follow."""
        value, *names = self.signal.names
        yield from fit_sentences(value, names if resampled else self.missing, self.labels, self.time, fit)
        if not resampled:
            yield from mismatches(self.signal.names, self.labels, self.time, self.derivatives, fit)

    def stretched(self, factor: float) -> Samples:
        """The same values further apart; what was given of derivatives becomes smaller."""
        derivatives = tuple(
            None if given is None else given / factor**order
            for order, given in enumerate(self.derivatives, start=1)
        )
        return replace(self, time=stretch(self.time, self.time[0], factor), derivatives=derivatives)


@dataclass(frozen=True, eq=False, kw_only=True)
class SampledProfile:
    """A signal known at recorded times.

    At these times its derivatives are the given ones, and those of a fit where none are given; its values are
    the samples where all derivatives are given or the fit goes through the samples, else those of the fit.

    Attributes:
        record: what was recorded.
        fit: of the values.
        resampled: whether the steps are not the recorded times; only the fit counts then.
        warnings: which numbers are estimates, and given derivatives that do not follow from the values.
    """

    record: Samples
    fit: Fit
    resampled: bool = False
    warnings: tuple[str, ...] = ()

    @classmethod
    def of(cls, record: Samples, method: str | None = None, *, resampled: bool = False) -> SampledProfile:
        """Fit samples that have no problems.

        Args:
            record: the samples.
            method: "lsq", "interpolate", or None to decide by their noise; see `fit_samples`.
            resampled: whether the steps are not the recorded times.
        """
        signal = record.signal
        with np.errstate(
            over="ignore", invalid="ignore"
        ):  # a range of 1e100 in 1e-30 s is judged by the robot
            fit = fit_samples(record.time, record.values, signal.spline_degree, signal.orders - 1, method)
            warnings = tuple(record.warnings(fit, resampled=resampled))
        return cls(record=record, fit=fit, resampled=resampled, warnings=warnings)

    @property
    def signal(self) -> Signal:
        """What is described."""
        return self.record.signal

    @property
    def components(self) -> int:
        """Number of components: one a joint, or six of a wrench."""
        return len(self.record.values)

    @property
    def notes(self) -> tuple[str, ...]:
        """The given derivatives, if they play no part."""
        record = self.record
        given = [name for name in record.signal.names[1:] if name not in record.missing]
        if not self.resampled or not given:
            return ()
        verb = "plays" if len(given) == 1 else "play"
        return (f"the given {', '.join(given)} {verb} no part, since the steps are resampled",)

    @property
    def fitted(self) -> bool:
        """Whether any number at the steps comes from the fit."""
        return self.resampled or not self.record.complete

    def summary(self) -> dict[str, Any] | None:
        """The fit in JSON values, for the report: see `describe`; None if nothing comes from it."""
        return describe(self.record.signal.names[0], self.record.labels, self.fit) if self.fitted else None

    @property
    def breakpoints(self) -> FloatArray:
        """Ascending times between which the fit is analytic; the first and last are its span."""
        return self.fit.breakpoints if self.fit.parts else self.record.time[[0, -1]]

    def samples(self, start: int, stop: int, time: FloatArray, /) -> FloatArray:
        """Value and derivatives at the samples start..stop-1: what was given, and for the rest the fit."""
        record = self.record
        if self.resampled:
            return self.at(time)
        if record.complete:
            rows = np.empty((record.signal.orders, self.components, len(time)))
            exact = np.ones(self.components, dtype=bool)
        else:
            rows = self.at(time)
            exact = self.fit.exact
        rows[0, exact] = record.values[exact, start:stop]
        for row, given in zip(rows[1:], record.derivatives, strict=True):
            if given is not None:
                row[:] = given[:, start:stop]
        return rows

    def at(self, time: FloatArray) -> FloatArray:
        """The fit and its derivatives at any times of the span, shape (orders, components, samples)."""
        return self.fit.at(time, self.record.signal.orders)

    def stretched(self, factor: float) -> SampledProfile:
        """The same course, slower by a factor; the warnings are those about the record."""
        return replace(self, record=self.record.stretched(factor), fit=self.fit.stretched(factor))


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


def _checked_rows(name: str, array: npt.ArrayLike, samples: int, components: int | None) -> FloatArray:
    return by_joint(checked_array(name, array, samples, components))


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
    given = np.flatnonzero(samples.given).tolist()
    for column, rows in zip(signal.names, (samples.values, *samples.derivatives), strict=True):
        for joint, row in () if rows is None else zip(given, rows[given], strict=True):
            yield from _breach(column, joint, samples.time, row, np.isfinite(row), "finite")
            small = ~(np.isfinite(row) & (np.abs(row) > LARGEST))
            yield from _breach(column, joint, samples.time, row, small, f"at most {LARGEST:g} in size")
    if signal.positive:
        for joint, row in zip(given, samples.values[given], strict=True):
            yield from _breach(name, joint, samples.time, row, ~(row <= 0), "positive")


def _breach(
    quantity: str, joint: int, time: FloatArray, row: FloatArray, holds: BoolArray, requirement: str
) -> Iterator[SampleProblem]:
    """The first sample at which a requirement does not hold, and how many there are."""
    if holds.all():
        return
    first, count = int(np.argmin(holds)), len(holds) - int(np.count_nonzero(holds))
    message = f"must be {requirement}, not {row[first]:g} (t = {time[first]:g} s"
    message += ")" if count == 1 else f"; {count} such samples)"
    yield SampleProblem(quantity, message, joint, first)
