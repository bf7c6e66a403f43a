"""Sums of sinusoids, the excitation of identification experiments: profile, and its declaration in files."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np

from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem, InputError
from vsacli.base.signals import POSITION
from vsacli.documents.fields import NON_NEGATIVE, POSITIVE, Items, PerJoint, number, value
from vsacli.trajectory.curves.closed_form import (
    ClosedForm,
    Formula,
    Use,
    Values,
    nan_for_none,
    rescale,
)
from vsacli.trajectory.curves.steps import profile_of_levels
from vsacli.trajectory.times import MAX_STEPS

RAMP_DEGREE = 9
"""Degree of the ramps at both ends, so that four derivatives vanish there."""

SAMPLES_PER_PERIOD = 64
"""Samples per period of the highest harmonic in the search for a minimum, and at least as many in a ramp: an
extremum is at most 0.12 % of the amplitudes beyond adjacent samples."""

HALVINGS = 40
"""Bisections between two such samples, after which the extremum is exact up to rounding."""


class Lowest(NamedTuple):
    """The smallest value of each component, (components,), and its first time, s."""

    value: FloatArray
    at: FloatArray


@dataclass(frozen=True, kw_only=True)
class Sinusoids(ClosedForm):
    """The sum offset + sum over k = 1, 2, ... of sine_k sin(k w t) + cosine_k cos(k w t).

    Time t counts from the start. It is the finite Fourier series of Swevers, Ganseman, Tukel, De Schutter &
    Van Brussel (IEEE Trans. Robotics and Automation 13(5), 1997).

    Attributes:
        cycles: periods of the lowest harmonic in the span, w = 2 pi cycles / duration.
        offset: offsets of the components.
        sine, cosine: amplitudes of the components, for each harmonic.
        ramp: share of the span in which the sum rises from zero at the start, and falls to zero at the end;
            its first four derivatives are then zero there, too.
    """

    cycles: float
    offset: tuple[float, ...]
    sine: tuple[tuple[float, ...], ...]
    cosine: tuple[tuple[float, ...], ...]
    ramp: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if any(len(amplitudes) != len(self.offset) for amplitudes in (*self.sine, *self.cosine)):
            raise InputError.one("offset, sine and cosine must have the same number of components")
        if not 0 < self.cycles < math.inf:
            raise InputError.one(f"the number of cycles must be positive, not {self.cycles:g}")
        if not 0 <= self.ramp <= 0.5:
            raise InputError.one(f"a ramp must take at most half of the time, not {self.ramp:g} of it")

    @property
    def components(self) -> int:
        """See `Profile.components`."""
        return len(self.offset)

    @property
    def breakpoints(self) -> FloatArray:
        """Ends of the span and of the ramps."""
        return np.unique([*self.span, *(time for ends in self._ramps() for time in ends)])

    def _ramps(self) -> list[tuple[float, float]]:
        (first, last), ramp = self.span, self.ramp * (self.span[1] - self.span[0])
        return [(first, first + ramp), (max(last - ramp, first + ramp), last)] if ramp else []

    def at(self, time: FloatArray) -> FloatArray:
        """See `Profile.at`."""
        derivatives = self._series(time)
        if self.ramp:
            window = profile_of_levels(
                self.signal, self.span, RAMP_DEGREE, ((0.0,), (1.0,), (0.0,)), self._ramps()
            )
            derivatives = _product(window.at(time), derivatives)
        derivatives[0] += np.array(self.offset)[:, None]
        return derivatives

    def lowest(self) -> Lowest:
        """Return the smallest values over the span."""
        stretch_minima = [self._sampled_lowest(time) for time in self._times_to_search()]
        values, times = (np.stack(rows) for rows in zip(*stretch_minima, strict=True))
        first_index = np.nan_to_num(values, nan=np.inf).argmin(axis=0), np.arange(self.components)
        return Lowest(values[first_index], times[first_index])

    def _times_to_search(self) -> Iterator[FloatArray]:
        """Yield ascending times of stretches that together contain the smallest value.

        Between the ramps one period is enough. In a ramp, the period next to the middle of the span is
        enough, since values a period farther out are the same, scaled down. Both ends have the offset.
        """
        first, last = self.span
        period = (last - first) / self.cycles
        (_, rise), (fall, _) = self._ramps() or [(first, first), (last, last)]
        harmonics = max(len(self.sine), len(self.cosine))
        for low, high in (
            (rise, min(rise + period, fall)),
            (max(rise - period, first), rise),
            (fall, min(fall + period, last)),
        ):
            count = math.ceil(SAMPLES_PER_PERIOD * (1 + harmonics * (high - low) / period))
            yield np.linspace(low, high, count + 1)
        yield np.array(self.span)

    def _sampled_lowest(self, time: FloatArray) -> Lowest:
        """Return the smallest of the values at ascending times and at the minima next to them."""
        values = self.at(time)[0]
        lowest = Lowest(np.full(self.components, np.nan), np.full(self.components, np.nan))
        for component in np.flatnonzero(~np.isnan(values[:, 0])).tolist():
            times = np.union1d(time, self._minima(time, values[component], component))
            component_values = self.at(times)[0, component]
            best_index = component_values.argmin()
            lowest.value[component], lowest.at[component] = component_values[best_index], times[best_index]
        return lowest

    def _minima(self, time: FloatArray, values: FloatArray, component: int) -> FloatArray:
        """Return the times of minima, by bisection next to samples without a smaller neighbor."""
        previous_values = np.concatenate(([np.inf], values[:-1]))
        next_values = np.concatenate((values[1:], [np.inf]))
        minimum_indices = np.flatnonzero((values < previous_values) & (values <= next_values))
        low, high = (
            time[np.maximum(minimum_indices - 1, 0)],
            time[np.minimum(minimum_indices + 1, len(time) - 1)],
        )
        for _ in range(HALVINGS):
            midpoint = (low + high) / 2
            is_falling = self.at(midpoint)[1, component] < 0
            low, high = np.where(is_falling, midpoint, low), np.where(is_falling, high, midpoint)
        return (low + high) / 2

    def rescaled(self, factors: Sequence[float], constants: Sequence[float]) -> Self:
        """See `ClosedForm.rescaled`."""
        nothing = (0.0,) * self.components
        sine, cosine = (
            tuple(rescale(harmonic, factors, nothing) for harmonic in harmonics)
            for harmonics in (self.sine, self.cosine)
        )
        return replace(self, offset=rescale(self.offset, factors, constants), sine=sine, cosine=cosine)

    def _series(self, time: FloatArray) -> FloatArray:
        first, last = self.span
        turns = self.cycles * ((time - first) / (last - first))
        rows = np.zeros((self.signal.orders, self.components, len(time)))
        for k, sine, cosine in self._harmonics():
            angle = 2 * math.pi * (k * turns)
            value, slope = np.sin(angle), np.cos(angle)
            speed = 2 * math.pi * k * self.cycles / np.float64(last - first)
            for order, row in enumerate(rows):
                row += speed**order * (np.multiply.outer(sine, value) + np.multiply.outer(cosine, slope))
                value, slope = slope, -value
        return rows

    def _harmonics(self) -> Iterator[tuple[int, FloatArray, FloatArray]]:
        none = (0.0,) * self.components
        for k in range(max(len(self.sine), len(self.cosine))):
            sine, cosine = (series[k] if k < len(series) else none for series in (self.sine, self.cosine))
            yield k + 1, np.array(sine), np.array(cosine)


def _product(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return value and derivatives of a product, by Leibniz' rule."""
    rows = np.zeros(np.broadcast_shapes(left.shape, right.shape))
    for order, row in enumerate(rows):
        for k in range(order + 1):
            row += math.comb(order, k) * left[k] * right[order - k]
    return rows


MAX_HARMONICS = 100
"""Most harmonics; more are considered a mistake, since identification uses about five."""

LEAST_SHARE = 1e-12
"""Share of the offset to which a signal that must be positive may fall; less is zero up to rounding."""


class SumOfSinusoids(Formula):
    """offset + sum over k = 1, 2, ... of sine_k sin(k w t) + cosine_k cos(k w t) with w = 2 pi frequency.

    The periodic excitation of identification experiments (Swevers et al., IEEE Transactions on Robotics and
    Automation, 1997); t counts from the start. Without `ramp` it begins and ends in motion.
    """

    frequency: float
    offset: Values
    sine: tuple[Values, ...]
    cosine: tuple[Values, ...]
    ramp: float

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """Return the declared fields by name."""
        amplitudes = Items(PerJoint(use.signal.quantities[0], use.signal.key))
        subject = "robot" if use.signal is POSITION else use.signal.key
        about = "the joint moves" if use.signal is POSITION else "it oscillates"
        sine = "amplitudes of sin(k w t), one entry for each k from 1 on"
        ramp = (
            "time in which the sum rises from zero at the start, and falls to zero at the end, so that the"
            f" {subject} begins and ends at rest at the offset"
        )
        return {
            "frequency": number(units.RATE, "frequency of the lowest harmonic, k = 1", check=POSITIVE),
            "offset": use.one(f"about which {about}"),
            "sine": value(amplitudes, sine, default=()),
            "cosine": value(
                amplitudes, "amplitudes of cos(k w t), one entry for each k from 1 on", default=()
            ),
            "ramp": number(units.TIME, ramp, check=NON_NEGATIVE, default=0.0),
        }

    @classmethod
    def meaning(cls, use: Use) -> str:
        """Return the meaning for users."""
        if use.signal is POSITION:
            return super().meaning(use)
        positive = ", which must stay positive" if use.signal.positive else ""
        return f"A sum of sinusoids as above{positive}. Without `ramp` it does not start at rest."

    def _problems(self) -> Iterator[FieldProblem]:
        if not (self.sine or self.cosine):
            yield FieldProblem((), "missing key 'sine' or 'cosine' (amplitudes)")
        for name in ("sine", "cosine"):
            count = len(getattr(self, name))
            if count > MAX_HARMONICS:
                yield FieldProblem((name,), f"at most {MAX_HARMONICS} harmonics are possible, not {count}")

    def profile_over(self, span: tuple[float, float]) -> Sinusoids:
        """See `Formula.profile_over`."""
        duration = span[1] - span[0]
        return Sinusoids(
            signal=self.signal,
            span=span,
            cycles=self.frequency * duration,
            offset=nan_for_none(self.offset),
            sine=tuple(map(nan_for_none, self.sine)),
            cosine=tuple(map(nan_for_none, self.cosine)),
            ramp=self.ramp / duration,
        )

    def problems_over(self, duration: float) -> Iterator[FieldProblem]:
        """See `Formula.problems_over`."""
        if 2 * self.ramp > duration:
            message = f"must take at most half of the {duration:g} s, not {self.ramp:g} s"
            yield FieldProblem(("ramp",), message)
        elif not self.frequency * duration <= MAX_STEPS:
            cycles = f"{self.frequency * duration:.4g} periods in {duration:g} s"
            yield FieldProblem(("frequency",), f"gives {cycles}; at most {MAX_STEPS:.0e} are possible")
        else:
            problems = list(super().problems_over(duration))
            yield from problems or self._not_positive(duration)

    def _not_positive(self, duration: float) -> Iterator[FieldProblem]:
        """Yield a problem for each component of a signal that must stay positive but does not."""
        if not self.signal.positive:
            return
        lowest, when = self.profile_over((0.0, duration)).lowest()
        offset = np.array(self.offset, dtype=np.float64)
        for joint in np.flatnonzero(lowest <= LEAST_SHARE * offset).tolist():
            fall = f"the sum falls to {lowest[joint]:.4g} after {when[joint]:.3f} s"
            enough = f"take one above {offset[joint] - lowest[joint]:.6g}, or smaller amplitudes"
            yield FieldProblem(("offset",), f"{fall}, but must stay positive; {enough}", joint)
