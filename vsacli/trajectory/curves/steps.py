"""Sequences of profiles, and constant levels with rest-to-rest changes between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple, Self

import numpy as np

from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem, InputError
from vsacli.base.signals import WRENCH, Signal
from vsacli.documents.fields import NON_NEGATIVE, POSITIVE, Items, NumberWithUnit, integer, number, value
from vsacli.trajectory.curves.closed_form import (
    DEGREES,
    SAME_TIME,
    ClosedForm,
    ConstantProfile,
    Formula,
    Use,
    Values,
    nan_for_none,
    odd,
)
from vsacli.trajectory.curves.polynomial import AXES, RestToRest
from vsacli.trajectory.times import stretch

CONTINUOUS = 1e-9
"""Largest jump that counts as continuous, relative to the peak of the value or derivative in both parts."""

PROBES = 101
"""Times at which each part is evaluated for its peak."""


class Jump(NamedTuple):
    """A jump between the end of one part and the start of the next.

    Attributes:
        part: index of the later part.
        order: order of the lowest derivative that jumps there; 0 for the value.
        component: index of the component. For derivatives only the first that jumps is reported.
        before, after: values on both sides of the jump.
    """

    part: int
    order: int
    component: int
    before: float
    after: float


@dataclass(frozen=True, kw_only=True)
class PiecewiseProfile(ClosedForm):
    """A sequence of profiles, each of which begins when the previous one ends.

    Attributes:
        parts: profiles of the same signal and components, whose spans are adjacent and fill the chain's.
    """

    parts: tuple[ClosedForm, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        ends = [self.span[0], *(end for part in self.parts for end in part.span), self.span[1]]
        if ends[::2] != ends[1::2]:
            raise InputError.one("the parts of a profile must adjoin and fill its span")
        if len({part.components for part in self.parts}) > 1:
            raise InputError.one("the parts of a profile must have the same number of components")

    @property
    def components(self) -> int:
        """See `Profile.components`."""
        return self.parts[0].components

    @cached_property
    def breakpoints(self) -> FloatArray:
        """Breakpoints of the parts."""
        return np.unique(np.concatenate([part.breakpoints for part in self.parts]))

    def at(self, time: FloatArray) -> FloatArray:
        """Return value and derivatives at any times of the span, shape (orders, components, samples).

        Where two parts meet, the later one is used.
        """
        starts = [part.span[0] for part in self.parts]
        part_indices = np.searchsorted(starts[1:], time, side="right")
        derivatives = np.empty((self.signal.orders, self.components, len(time)))
        for index in np.unique(part_indices).tolist():
            in_part = part_indices == index
            derivatives[:, :, in_part] = self.parts[index].at(time[in_part])
        return derivatives

    def stretched(self, factor: float) -> Self:
        """Return the profile with every part slowed down by a factor."""

        def later(span: tuple[float, float]) -> tuple[float, float]:
            start, end = (stretch(time, self.span[0], factor) for time in span)
            return start, end

        parts = tuple(replace(part, span=later(part.span)) for part in self.parts)
        return replace(self, span=later(self.span), parts=parts)

    def rescaled(self, factors: Sequence[float], constants: Sequence[float]) -> Self:
        """See `ClosedForm.rescaled`."""
        return replace(self, parts=tuple(part.rescaled(factors, constants) for part in self.parts))

    def jumps(self, orders: int) -> Iterator[Jump]:
        """Yield the jumps between parts, of the value and derivatives of order below `orders`."""
        for index, (previous_part, next_part) in enumerate(pairwise(self.parts), start=1):
            end_values, start_values = (
                previous_part.at(np.array(previous_part.span)),
                next_part.at(np.array(next_part.span)),
            )
            difference = np.abs(start_values[:orders, :, 0] - end_values[:orders, :, 1])
            peaks = np.maximum(_peak_magnitudes(previous_part), _peak_magnitudes(next_part))[:orders]
            discontinuous = np.argwhere(difference > CONTINUOUS * peaks).tolist()
            lowest = [
                (order, component) for order, component in discontinuous if order == discontinuous[0][0]
            ]
            for order, component in lowest if lowest and lowest[0][0] == 0 else lowest[:1]:
                sides = end_values[order, component, 1], start_values[order, component, 0]
                yield Jump(index, order, component, *map(float, sides))


def _peak_magnitudes(profile: ClosedForm) -> FloatArray:
    """Return the largest magnitude of each order and component, (orders, components)."""
    return np.asarray(np.abs(profile.at(np.linspace(*profile.span, PROBES))).max(axis=2))


def profile_of_levels(
    signal: Signal,
    span: tuple[float, float],
    degree: int,
    levels: Sequence[tuple[float, ...]],
    changes: Sequence[tuple[float, float]],
) -> PiecewiseProfile:
    """Return constant levels with rest-to-rest changes between them.

    Args:
        signal: signal of the profile.
        span: first and last time, s.
        degree: degree of the changes.
        levels: values of the components, for each level.
        changes: start and end of each change, s; one less than levels.
    """
    parts: list[ClosedForm] = []
    hold_start = span[0]
    for (level, next_level), (start, end) in zip(pairwise(levels), changes, strict=True):
        if start > hold_start:
            parts.append(ConstantProfile(signal=signal, span=(hold_start, start), value=level))
        parts.append(RestToRest(signal=signal, span=(start, end), degree=degree, start=level, end=next_level))
        hold_start = end
    if span[1] > hold_start:
        parts.append(ConstantProfile(signal=signal, span=(hold_start, span[1]), value=levels[-1]))
    return PiecewiseProfile(signal=signal, span=span, parts=tuple(parts))


_SMOOTH = "two derivatives must vanish where a change begins"


class Steps(Formula):
    """Constant levels, with rest-to-rest changes from each to the next."""

    degree: int
    levels: tuple[Values, ...]
    times: tuple[float, ...]
    transition: float

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """Return the declared fields by name."""
        degree = "degree of the polynomials that lead from level to level"
        times = "start times of the changes, from the start of the signal; one less than levels"
        axes = f" {AXES.removeprefix(', ')}" if use.signal is WRENCH else ""
        return {
            **use.frame(),
            "degree": integer(degree, check=odd(DEGREES, 2 * use.smoothness + 1, _SMOOTH)),
            "levels": use.several(f"{axes} of the levels, in order"),
            "times": value(Items(NumberWithUnit(units.TIME)), times, check=NON_NEGATIVE),
            "transition": number(units.TIME, "duration of each change", check=POSITIVE),
        }

    def _problems(self) -> Iterator[FieldProblem]:
        if len(self.times) != len(self.levels) - 1:
            expected = f"{len(self.levels) - 1}, one for each level but the first"
            yield FieldProblem(("times",), f"expected {expected}, found {len(self.times)}")
        for index, (change_time, next_change_time) in enumerate(pairwise(self.times), start=1):
            if not change_time + self.transition <= next_change_time * (1 + SAME_TIME):
                message = f"{next_change_time:g} s is before the change that begins at {change_time:g} s ends"
                yield FieldProblem(("times", index), f"{message}, {self.transition:g} s later")

    def problems_over(self, duration: float) -> Iterator[FieldProblem]:
        """See `Formula.problems_over`."""
        end = self.times[-1] + self.transition
        if not end <= duration * (1 + SAME_TIME):
            message = f"the last change ends at {end:.10g} s, the trajectory at {duration:.10g} s"
            yield FieldProblem(("times", len(self.times) - 1), message)
        else:
            yield from super().problems_over(duration)

    def profile_over(self, span: tuple[float, float]) -> PiecewiseProfile:
        """See `Formula.profile_over`."""
        starts = [span[0] + time for time in self.times]
        ends = [
            min(start + self.transition, after) for start, after in pairwise([*starts, span[1]])
        ]  # rounding must not make them overlap
        levels, changes = list(map(nan_for_none, self.levels)), list(zip(starts, ends, strict=True))
        return profile_of_levels(self.signal, span, self.degree, levels, changes)
