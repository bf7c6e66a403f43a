"""Profiles through recorded samples: columns that are given, and an interpolating spline for the others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from vsacli.arrays import BoolArray, FloatArray, by_joint
from vsacli.errors import InputError
from vsacli.profiles import Signal
from vsacli.times import stretch

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


@dataclass(frozen=True, eq=False, kw_only=True)
class SampledProfile:
    """A signal known at recorded times; `time_problems` and `value_problems` check what it rests on.

    Attributes:
        signal: what is described.
        time: (samples,) in s.
        values: (components, samples); NaN throughout if the signal is optional and a component has none.
        derivatives: for each derivative of the signal the given values, (components, samples), or None.
    """

    signal: Signal
    time: FloatArray = field(repr=False)
    values: FloatArray = field(repr=False)
    derivatives: tuple[FloatArray | None, ...] = field(repr=False)

    @classmethod
    def from_arrays(
        cls, signal: Signal, time: FloatArray, values: npt.ArrayLike, *derivatives: npt.ArrayLike | None
    ) -> SampledProfile:
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
        return cls(signal=signal, time=time, values=rows, derivatives=further)

    @property
    def components(self) -> int:
        """Number of components: one a joint, or six of a wrench."""
        return len(self.values)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Which derivatives were not given."""
        value, *names = self.signal.names
        missing = [name for name, given in zip(names, self.derivatives, strict=True) if given is None]
        if not missing:
            return ()
        verb = "comes" if len(missing) == 1 else "come"
        smoothness = self.signal.spline_degree - 1
        return (f"{', '.join(missing)} {verb} from a C{smoothness} spline through {value}",)

    @cached_property
    def breakpoints(self) -> FloatArray:
        """Knots of the spline: the samples without the ones next to the ends ("not a knot")."""
        margin = (self.signal.spline_degree + 1) // 2
        return np.concatenate([self.time[:1], self.time[margin:-margin], self.time[-1:]])

    @cached_property
    def _spline(self) -> BSpline[np.float64]:
        from scipy.interpolate import make_interp_spline

        return make_interp_spline(self.time, self.values[self.given].T, k=self.signal.spline_degree)

    @cached_property
    def given(self) -> BoolArray:
        """Which components have values, (components,)."""
        absent: BoolArray = np.all(np.isnan(self.values), axis=1)
        return ~absent if self.signal.optional else np.ones_like(absent)

    def samples(self, start: int, stop: int, time: FloatArray, /) -> FloatArray:
        """Value and derivatives at the samples start..stop-1: what was given, and for the rest the spline."""
        if any(given is None for given in self.derivatives):
            rows = self.at(time)
        else:
            rows = np.empty((self.signal.orders, self.components, len(time)))
        for row, given in zip(rows, (self.values, *self.derivatives), strict=True):
            if given is not None:
                row[:] = given[:, start:stop]
        return rows

    def stretched(self, factor: float) -> SampledProfile:
        """The same values further apart; what was given of derivatives becomes smaller."""
        derivatives = tuple(
            None if given is None else given / factor**order
            for order, given in enumerate(self.derivatives, start=1)
        )
        return replace(self, time=stretch(self.time, self.time[0], factor), derivatives=derivatives)

    def at(self, time: FloatArray) -> FloatArray:
        """The spline and its derivatives at any times of the span, shape (orders, components, samples).

        Within a knot span one polynomial is evaluated, so that neighbouring values share their rounding
        error; evaluating derivatives of B-splines point by point leaves noise of about eps / step^order.
        """
        degree, knots = self.signal.spline_degree, self.breakpoints
        span = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(knots) - 2)
        used, which = np.unique(span, return_inverse=True)
        offset = time - knots[span]
        taylor = [self._spline(knots[used], nu=order).T[:, which] for order in range(degree + 1)]

        rows = np.full((self.signal.orders, self.components, len(time)), np.nan)
        for order, row in enumerate(rows):
            total = taylor[degree].copy()
            for power in range(degree - order, 0, -1):
                total *= offset / power
                total += taylor[order + power - 1]
            row[self.given] = total
        return rows


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


def value_problems(profile: SampledProfile) -> Iterator[SampleProblem]:
    """What keeps these values from being used: too few, or not finite, or not positive where they must be."""
    signal, degree = profile.signal, profile.signal.spline_degree
    name, count = signal.names[0], len(profile.time)
    if count <= degree:
        yield SampleProblem(
            name, f"needs at least {degree + 1} samples for a C{degree - 1} spline, not {count}"
        )
    given = np.flatnonzero(profile.given).tolist()
    for column, rows in zip(signal.names, (profile.values, *profile.derivatives), strict=True):
        for joint, row in () if rows is None else zip(given, rows[given], strict=True):
            yield from _breach(column, joint, profile.time, row, np.isfinite(row), "finite")
    if signal.positive:
        for joint, row in zip(given, profile.values[given], strict=True):
            yield from _breach(name, joint, profile.time, row, ~(row <= 0), "positive")


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
