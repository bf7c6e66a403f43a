"""The base class of profiles in closed form, and the simplest of them, a constant."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.signals import Signal
from vsacli.trajectory.times import stretch

SHORTEST, LONGEST = 1e-30, 1e30
"""Range of durations, s, whose fourth powers neither overflow nor underflow."""

DEGREES = range(3, 16, 2)
"""Degrees of rest-to-rest polynomials."""

VIA_DEGREES = range(3, 10, 2)
"""Degrees of splines through points; higher degrees lose too many digits."""


@dataclass(frozen=True, kw_only=True)
class ClosedForm(ABC):
    """A profile in closed form, analytic between its breakpoints; its span is in s."""

    signal: Signal
    span: tuple[float, float]

    warnings: ClassVar[tuple[str, ...]] = ()
    notes: ClassVar[tuple[str, ...]] = ()
    known_between: ClassVar[bool] = True
    estimate: ClassVar[None] = None

    def __post_init__(self) -> None:
        first, last = self.span
        if not SHORTEST <= last - first <= LONGEST:
            allowed = f"a positive time ({SHORTEST:g} to {LONGEST:g} s)"
            raise InputError.one(f"a profile must last {allowed}, not from {first:g} to {last:g} s")

    @property
    @abstractmethod
    def components(self) -> int:
        """Number of components: one per joint, or six of a wrench."""

    @property
    def breakpoints(self) -> FloatArray:
        """Ends of the span."""
        return np.array(self.span)

    @abstractmethod
    def at(self, time: FloatArray) -> FloatArray:
        """Return value and derivatives at any times of the span, shape (orders, components, samples)."""

    def samples(self, _start: int, _stop: int, time: FloatArray, /) -> FloatArray:
        """Return the same at samples, whose times are `time`."""
        return self.at(time)

    def stretched(self, factor: float) -> Self:
        """Return the profile slowed down by a factor."""
        first, last = self.span
        return replace(self, span=(first, stretch(last, first, factor)))

    @abstractmethod
    def raised(self, by: Sequence[float]) -> Self:
        """Return the profile with a constant added to each component."""

    @abstractmethod
    def scaled(self, by: Sequence[float]) -> Self:
        """Return the profile with each component multiplied by a constant."""


def add_constants(values: Sequence[float], by: Sequence[float]) -> tuple[float, ...]:
    """Return the sums of two values for each component."""
    return tuple(value + constant for value, constant in zip(values, by, strict=True))


def multiply_constants(values: Sequence[float], by: Sequence[float]) -> tuple[float, ...]:
    """Return the products of two values for each component."""
    return tuple(value * constant for value, constant in zip(values, by, strict=True))


@dataclass(frozen=True, kw_only=True)
class ConstantProfile(ClosedForm):
    """A constant `value`, one number per component."""

    value: tuple[float, ...]

    @property
    def components(self) -> int:
        """Number of components: one per joint, or six of a wrench."""
        return len(self.value)

    def at(self, time: FloatArray) -> FloatArray:
        """See `ClosedForm.at`."""
        rows = np.zeros((self.signal.orders, self.components, len(time)))
        rows[0] = np.array(self.value)[:, None]
        return rows

    def raised(self, by: Sequence[float]) -> Self:
        """See `ClosedForm.raised`."""
        return replace(self, value=add_constants(self.value, by))

    def scaled(self, by: Sequence[float]) -> Self:
        """See `ClosedForm.scaled`."""
        return replace(self, value=multiply_constants(self.value, by))
