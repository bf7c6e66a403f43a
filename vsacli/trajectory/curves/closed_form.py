"""Profiles given by a formula, and the simplest of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.signals import Signal
from vsacli.trajectory.times import stretch

SHORTEST, LONGEST = 1e-30, 1e30
"""Durations of profiles, s, of which the fourth power is still a number."""

DEGREES = range(3, 16, 2)
"""Degrees of rest-to-rest polynomials."""

VIA_DEGREES = range(3, 10, 2)
"""Degrees of splines through points; those of higher degree lose too many digits."""


@dataclass(frozen=True, kw_only=True)
class ClosedForm(ABC):
    """A profile given by a formula, analytic between the two ends of its span, in s."""

    signal: Signal
    span: tuple[float, float]

    def __post_init__(self) -> None:
        first, last = self.span
        if not SHORTEST <= last - first <= LONGEST:
            allowed = f"a positive time ({SHORTEST:g} to {LONGEST:g} s)"
            raise InputError.one(f"a profile must last {allowed}, not from {first:g} to {last:g} s")

    @property
    @abstractmethod
    def components(self) -> int:
        """Number of components: one a joint, or six of a wrench."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Nothing: a formula leaves no doubt."""
        return ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Nothing: all that is given plays a part."""
        return ()

    @property
    def breakpoints(self) -> FloatArray:
        """The ends of the span."""
        return np.array(self.span)

    @property
    def known_between(self) -> bool:
        """True: steps are nothing special."""
        return True

    @abstractmethod
    def at(self, time: FloatArray) -> FloatArray:
        """Value and derivatives at any times of the span, shape (orders, components, samples)."""

    def samples(self, _start: int, _stop: int, time: FloatArray, /) -> FloatArray:
        """Return the same at the steps start..stop-1, whose times are `time`."""
        return self.at(time)

    @property
    def estimate(self) -> None:
        """None: no value comes from a fit of samples."""
        return None

    def stretched(self, factor: float) -> Self:
        """Return the same profile, slower by a factor."""
        first, last = self.span
        return replace(self, span=(first, stretch(last, first, factor)))

    @abstractmethod
    def raised(self, by: Sequence[float]) -> Self:
        """Return the same profile with a constant added to each component."""


def added(values: Sequence[float], by: Sequence[float]) -> tuple[float, ...]:
    """Return the sum of two values of each component."""
    return tuple(value + constant for value, constant in zip(values, by, strict=True))


@dataclass(frozen=True, kw_only=True)
class Constant(ClosedForm):
    """The same `value`, one number a component, all the time."""

    value: tuple[float, ...]

    @property
    def components(self) -> int:
        """Number of components: one a joint, or six of a wrench."""
        return len(self.value)

    def at(self, time: FloatArray) -> FloatArray:
        """Value and derivatives at any times of the span, shape (orders, components, samples)."""
        rows = np.zeros((self.signal.orders, self.components, len(time)))
        rows[0] = np.array(self.value)[:, None]
        return rows

    def raised(self, by: Sequence[float]) -> Self:
        """Return the same profile with a constant added to each component."""
        return replace(self, value=added(self.value, by))
