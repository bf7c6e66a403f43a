"""Rest-to-rest polynomials and constant values: profiles, and their declarations in files."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import mul
from typing import Any, Self

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.signals import POSITION, WRENCH
from vsacli.base.wrench import WRENCH_AXES
from vsacli.compute.vector import Scalar
from vsacli.documents.fields import integer
from vsacli.trajectory.curves.closed_form import (
    DEGREES,
    ClosedForm,
    ConstantProfile,
    Formula,
    Use,
    Values,
    nan_for_none,
    rescale,
)


@dataclass(frozen=True, kw_only=True)
class RestToRest(ClosedForm):
    """Polynomial whose derivatives up to (degree-1)/2 vanish at both ends of the span.

    Attributes:
        degree: degree, odd, 3 to 15.
        start, end: values of the components, exact at the ends.
    """

    degree: int
    start: tuple[float, ...]
    end: tuple[float, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.degree not in DEGREES:
            raise InputError.one(f"the degree must be odd, {DEGREES[0]} to {DEGREES[-1]}, not {self.degree}")
        if len(self.start) != len(self.end):
            raise InputError.one(f"start has {len(self.start)} values, end has {len(self.end)}")

    @property
    def components(self) -> int:
        """See `Profile.components`."""
        return len(self.start)

    def at(self, time: FloatArray) -> FloatArray:
        """See `Profile.at`."""
        start_time, end_time = self.span
        elapsed, remaining = time - start_time, end_time - time
        second_half = remaining < elapsed
        start, end = np.array(self.start)[:, None], np.array(self.end)[:, None]
        change = end - start

        derivatives = np.empty((self.signal.orders, self.components, len(time)))
        step_shape = _step_shape(
            _scalar(np.minimum(elapsed, remaining)) / (end_time - start_time), self.degree
        )
        np.multiply(change, np.where(second_half, -step_shape, step_shape), out=derivatives[0])
        derivatives[0] += np.where(second_half, end, start)
        shape_rates = _step_shape_rates(
            _scalar(elapsed), _scalar(remaining), end_time - start_time, self.degree
        )
        for derivative, shape_rate in zip(derivatives[1:], shape_rates, strict=False):
            np.multiply(change, shape_rate, out=derivative)
        return derivatives

    def rescaled(self, factors: Sequence[float], constants: Sequence[float]) -> Self:
        """See `ClosedForm.rescaled`."""
        start, end = (rescale(values, factors, constants) for values in (self.start, self.end))
        return replace(self, start=start, end=end)


def _scalar(times: FloatArray) -> Scalar:
    """Return a single time as a number; as an array, `trajectory.at` of a 7R takes 1.5 times as long."""
    return times.item() if len(times) == 1 else times


def _step_shape(u: Scalar, degree: int) -> Scalar:
    """Return the polynomial from 0 at u = 0 to 1 at u = 1.

    With m = (degree-1)/2 it is u^(m+1) sum over k = 0..m of binomial(m+k, k) (1-u)^k, whose terms are
    positive, so it is accurate for small u.
    """
    m = (degree - 1) // 2
    series, complement = 0.0 * u, 1 - u
    for k in range(m, -1, -1):
        series = series * complement + math.comb(m + k, k)
    return series * _integer_power(u, m + 1)


def _step_shape_rates(elapsed: Scalar, remaining: Scalar, duration: float, degree: int) -> Iterator[Scalar]:
    """Yield the time derivatives of order 1, 2, ... of the polynomial `_step_shape`.

    The first is c p^m / T with p = s (1-s), s = elapsed / T, m = (degree-1)/2 and c = degree! / m!^2. Since
    dp/ds = 1-2s and d(1-2s)/ds = -2, the others are also sums of terms p^i (1-2s)^j.
    """
    m = (degree - 1) // 2
    p, slope = elapsed / duration * (remaining / duration), (remaining - elapsed) / duration
    terms = {(m, 0): math.factorial(degree) / math.factorial(m) ** 2}
    scale = duration
    while True:
        rate: Scalar = 0.0
        for (i, j), c in terms.items():
            rate += c / scale * _integer_power(p, i) * _integer_power(slope, j)
        yield rate
        terms, scale = _differentiate_terms(terms), scale * duration


def _differentiate_terms(terms: dict[tuple[int, int], float]) -> dict[tuple[int, int], float]:
    """Return d/ds of the sum of terms c p^i (1-2s)^j, given and returned as {(i, j): c}."""
    derivative_terms: dict[tuple[int, int], float] = defaultdict(float)
    for (i, j), c in terms.items():
        if i:
            derivative_terms[i - 1, j + 1] += i * c
        if j:
            derivative_terms[i, j - 1] -= 2 * j * c
    return derivative_terms


def _integer_power(base: Scalar, exponent: int) -> Scalar:
    """Return base^exponent by multiplication, which is much faster than `**` on arrays."""
    return reduce(mul, [base] * exponent) if exponent else 1.0


AXES = f", `[{', '.join(WRENCH_AXES)}]`"


class Polynomial(Formula):
    """A polynomial from one value to another, at rest at both ends."""

    degree: int
    start: Values
    end: Values

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """Return the declared fields by name."""
        degree = "degree of the polynomial"
        if use.signal is not POSITION:
            degree += f", odd, {DEGREES[0]} to {DEGREES[-1]}"
        elif not use.rigid:
            degree += "; from 3 on if all joints are rigid"
        return {
            **use.frame(),
            "degree": integer(degree, check=use.degree(DEGREES)),
            "start": use.one("at the start" + (AXES if use.signal is WRENCH else "")),
            "end": use.one("at the end"),
        }

    @classmethod
    def meaning(cls, use: Use) -> str:
        """Return the meaning for users."""
        if use.rigid:
            sentence = "The same for a robot whose joints are all rigid"
            return f"{sentence}: its torques do not depend on jerk and snap."
        sentence = "Rest to rest" if use.signal is POSITION else f"From one {use.signal.key} to another"
        return f"{sentence}: all derivatives up to (degree-1)/2 vanish at both ends."

    def profile_over(self, span: tuple[float, float]) -> RestToRest:
        """See `Formula.profile_over`."""
        start, end = nan_for_none(self.start), nan_for_none(self.end)
        return RestToRest(signal=self.signal, span=span, degree=self.degree, start=start, end=end)


class Hold(Formula):
    """A constant value."""

    value: Values

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """Return the declared fields by name."""
        return {**use.frame(), "value": use.one("throughout" + (AXES if use.signal is WRENCH else ""))}

    @classmethod
    def meaning(cls, use: Use) -> str:
        """Return the meaning for users."""
        if use.signal is POSITION:
            return "The robot stands still."
        return f"Constant {use.signal.key}."

    def profile_over(self, span: tuple[float, float]) -> ConstantProfile:
        """See `Formula.profile_over`."""
        return ConstantProfile(signal=self.signal, span=span, value=nan_for_none(self.value))
