"""Sample times of a trajectory: a uniform grid, recorded times, or a uniform grid over recorded times."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError

_Time = TypeVar("_Time", float, FloatArray)

MAX_STEPS = 1_000_000_000
"""Largest number of intervals; more are considered a mistake in duration or rate."""


class Times(Protocol):
    """Sample times, both ends included."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the interpretation of the times, where that is not obvious."""

    @property
    def span(self) -> tuple[float, float]:
        """First and last time, s."""

    @property
    def samples(self) -> int:
        """Number of samples, both ends included."""

    def block(self, start: int, stop: int) -> FloatArray:
        """Return the times of samples start..stop-1; like a slice, clipped at the last sample."""

    def from_zero(self) -> Times:
        """Return the same times, counted from the first."""

    def stretched(self, factor: float) -> Times:
        """Return the times of the motion slowed down by a factor."""


@dataclass(frozen=True)
class UniformTimes:
    """Times t_k = k duration/n with n = round(duration rate), the last one exactly the duration.

    Attributes:
        duration: duration, s.
        rate: requested sample rate, 1/s.
    """

    duration: float
    rate: float

    def __post_init__(self) -> None:
        if not (0 < self.duration < math.inf and 0 < self.rate < math.inf):
            raise InputError.one(
                f"duration and rate must be positive, not {self.duration:.4g} s and {self.rate:.4g} Hz"
            )
        if self.duration * self.rate > MAX_STEPS:
            samples, max_samples = f"{self.duration * self.rate:.4g}", f"{MAX_STEPS:.4g}"
            raise InputError.one(
                f"duration {self.duration:.4g} s times rate {self.rate:.4g} Hz gives {samples} samples; "
                f"at most {max_samples} are possible; lower rate or duration"
            )

    @property
    def steps(self) -> int:
        """Number n of intervals."""
        return max(1, round(self.duration * self.rate))

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the interpretation of the times, where that is not obvious."""
        rate = self.steps / self.duration
        if math.isclose(rate, self.rate, rel_tol=1e-9):
            return ()
        return (
            f"the rate is {rate:.9g} Hz, not {self.rate:.9g} Hz, for a whole number of intervals in "
            f"{self.duration:g} s",
        )

    @property
    def span(self) -> tuple[float, float]:
        """First and last time, s."""
        return (0.0, self.duration)

    @property
    def samples(self) -> int:
        """Number of samples, both ends included."""
        return self.steps + 1

    def block(self, start: int, stop: int) -> FloatArray:
        """Return the times of samples start..stop-1; like a slice, clipped at the last sample."""
        time = np.arange(start, min(stop, self.samples)) * self.duration / self.steps
        if stop >= self.samples > start:
            time[-1] = self.duration
        return time

    def from_zero(self) -> UniformTimes:
        """See `Times.from_zero`; uniform times begin at zero."""
        return self

    def stretched(self, factor: float) -> UniformTimes:
        """Return a longer duration at the same rate."""
        return UniformTimes(stretch(self.duration, 0.0, factor), self.rate)


@dataclass(frozen=True, eq=False)
class RecordedTimes:
    """Times given sample by sample.

    Attributes:
        time: times, (samples,), s; see `time_problems` for their conditions.
        notes: notes on their interpretation, where that is not obvious.
    """

    time: FloatArray = field(repr=False)
    notes: tuple[str, ...] = ()

    @property
    def span(self) -> tuple[float, float]:
        """First and last time, s."""
        return (float(self.time[0]), float(self.time[-1]))

    @property
    def samples(self) -> int:
        """Number of samples, both ends included."""
        return len(self.time)

    def block(self, start: int, stop: int) -> FloatArray:
        """Return the times of samples start..stop-1; like a slice, clipped at the last sample."""
        return self.time[start:stop]

    def from_zero(self) -> RecordedTimes:
        """Return the same times, counted from the first."""
        return RecordedTimes(self.time - self.time[0], self.notes)

    def stretched(self, factor: float) -> RecordedTimes:
        """Return the same number of samples, further apart."""
        return RecordedTimes(stretch(self.time, self.time[0], factor), self.notes)


@dataclass(frozen=True)
class ResampledTimes:
    """Equally spaced times over the span of a recording; they keep their rate when stretched.

    Attributes:
        first: first time, s.
        last: last time, s.
        rate: requested sample rate, 1/s.

    Raises:
        InputError: the rate is not possible.
    """

    first: float
    last: float
    rate: float

    def __post_init__(self) -> None:
        _ = self._elapsed

    @property
    def _elapsed(self) -> UniformTimes:
        return UniformTimes(self.last - self.first, self.rate)

    @property
    def notes(self) -> tuple[str, ...]:
        """See `UniformTimes.notes`."""
        return self._elapsed.notes

    @property
    def span(self) -> tuple[float, float]:
        """First and last time, s."""
        return (self.first, self.last)

    @property
    def samples(self) -> int:
        """Number of samples, both ends included."""
        return self._elapsed.samples

    def block(self, start: int, stop: int) -> FloatArray:
        """Return the times of samples start..stop-1; like a slice, clipped at the last sample."""
        time = self.first + self._elapsed.block(start, stop)
        if stop >= self.samples > start:
            time[-1] = self.last
        return time

    def from_zero(self) -> UniformTimes:
        """Return the same times, counted from the first."""
        return self._elapsed

    def stretched(self, factor: float) -> ResampledTimes:
        """Return a longer span at the same rate."""
        return ResampledTimes(self.first, stretch(self.last, self.first, factor), self.rate)


def stretch(time: _Time, first: float, factor: float) -> _Time:
    """Return times, s, with their distances from `first` multiplied by a factor.

    Sample times and profiles share this rule.
    """
    return first + factor * (time - first)
