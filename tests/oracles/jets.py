"""Time derivatives of products of scalars and of matrices, over any ring of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb
from typing import Any

import numpy as np
import numpy.typing as npt

Scalar = Any
"""A number with + - *: float, complex, Fraction, or a NumPy row of samples."""


class Jet:
    """A scalar function of time at one instant: its value and first time derivatives."""

    def __init__(self, *derivatives: Scalar) -> None:
        self.derivatives = derivatives

    def __add__(self, other: Scalar) -> Jet:
        pairs = zip(self.derivatives, self._lift(other).derivatives, strict=True)
        return Jet(*(a + b for a, b in pairs))

    def __mul__(self, other: Scalar) -> Jet:
        a, b = self.derivatives, self._lift(other).derivatives
        return Jet(*(leibniz(order, a, b, lambda x, y: x * y) for order in range(len(a))))

    def __neg__(self) -> Jet:
        return Jet(*(-a for a in self.derivatives))

    def __sub__(self, other: Scalar) -> Jet:
        return self + self._lift(-other)

    def __rsub__(self, other: Scalar) -> Jet:
        return -self + self._lift(other)

    def __radd__(self, other: Scalar) -> Jet:
        return self + self._lift(other)

    def __rmul__(self, other: Scalar) -> Jet:
        return self * self._lift(other)

    def _lift(self, other: Scalar) -> Jet:
        """Constants have no derivatives."""
        return other if isinstance(other, Jet) else Jet(other, *(0 for _ in self.derivatives[1:]))


def leibniz(order: int, a: Sequence[Scalar], b: Sequence[Scalar], product: Any) -> Scalar:
    """Derivative of the given order of a bilinear product of a and b, whose derivatives are given."""
    return sum(comb(order, k) * product(a[k], b[order - k]) for k in range(order + 1))


def matrix_product(a: Sequence[Any], b: Sequence[Any]) -> list[npt.NDArray[Any]]:
    """Derivatives of the matrix a b, as far as both are known."""
    return [leibniz(order, a, b, np.matmul) for order in range(min(len(a), len(b)))]


def circle(cos: Scalar, sin: Scalar, rates: Sequence[Scalar]) -> tuple[list[Scalar], list[Scalar]]:
    """Derivatives of cos and sin of an angle, whose rates are given, by c' = -s a' and s' = c a'."""
    cosines, sines = [cos], [sin]
    for order in range(len(rates)):
        next_cosine = -leibniz(order, sines, rates, lambda x, y: x * y)
        next_sine = leibniz(order, cosines, rates, lambda x, y: x * y)
        cosines.append(next_cosine)
        sines.append(next_sine)
    return cosines, sines
