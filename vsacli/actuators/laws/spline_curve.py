"""Smooth curves on either side of zero: piecewise polynomial potentials, integrated from a B-spline.

The spline g is a function that must not change its sign, such as a slope over the deflection. The caller of
`spline_curve` gives the integration from g to the potential.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.compute.control_flow import Values, cell_of, look_up

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

Integrate = Callable[["PPoly"], "PPoly"]
"""Function from the spline to the potential, both over the absolute value of the deflection."""


@dataclass(frozen=True)
class SplineCurve:
    """A potential of two halves, on either side of zero, over the absolute value of the deflection.

    Attributes:
        domain: Deflections at the ends.
        pieces: Number of polynomials below zero and above; in either half of equal width.
        origins: Origins of the polynomials, (pieces,); zero next to zero, so that nothing cancels there.
        coefficients: Coefficients of the potential, from the constant on, (powers, pieces).
    """

    domain: tuple[float, float]
    pieces: tuple[int, int]
    origins: FloatArray
    coefficients: FloatArray

    def __call__(self, phi: FloatArray, first: int, last: int) -> tuple[FloatArray, ...]:
        """Return the derivatives of the potential from order `first`, 0 or 1, to order `last`, at most 4."""
        origin, *coefficients = look_up(self._coefficient_tables[first], self._piece_index(phi))
        magnitudes = _horner_derivatives(coefficients, np.abs(phi) - origin, last - first)
        side = np.copysign(1.0, phi)
        return tuple(
            side * magnitude if order % 2 else magnitude for order, magnitude in enumerate(magnitudes, first)
        )

    def _piece_index(self, phi: FloatArray) -> IndexArray:
        """Return the index of the polynomial; at an edge, rounding may choose the neighbor, equal there."""
        (low, high), (below, above) = self.domain, self.pieces
        position = phi * (above / high)
        if below:
            steeper = below / -low > above / high
            position = below + (np.minimum if steeper else np.maximum)(position, phi * (below / -low))
        return cell_of(position, below + above)

    @cached_property
    def _coefficient_tables(self) -> tuple[Values, Values]:
        """Origins with the coefficients of the potential, and of its derivative, each over the pieces."""
        return (self.origins, *self._derivative(0)), (self.origins, *self._derivative(1))

    def _derivative(self, order: int) -> FloatArray:
        """Return the coefficients of a derivative of the potential, ascending, (powers, pieces)."""
        powers = range(order, len(self.coefficients))
        factors = np.array([math.perm(power, order) for power in powers], dtype=float)
        return factors[:, None] * self.coefficients[order:]


def _horner_derivatives(coefficients: Sequence[FloatArray], x: FloatArray, order: int) -> list[FloatArray]:
    """Return a polynomial and its derivatives up to an order, by repeated Horner schemes."""
    *lower, highest = coefficients
    values = [highest]
    for coefficient in reversed(lower):
        leading = values[-1]
        for power in range(len(values) - 1, 0, -1):
            values[power] = values[power] * x + values[power - 1]
        values[0] = values[0] * x + coefficient
        if len(values) <= order:
            values.append(leading)
    return [math.factorial(power) * value if power > 1 else value for power, value in enumerate(values)]


def spline_knots(low: float, high: float, pieces: int, degree: int) -> FloatArray:
    """Return the knots of a spline from `low` at or below zero to `high` above, with a knot at zero."""
    above = max(1, round(pieces * high / (high - low)))
    below = max(1, pieces - above) if low < 0 else 0
    breaks = np.concatenate((np.linspace(low, 0, below, endpoint=False), np.linspace(0, high, above + 1)))
    return np.concatenate((np.full(degree, breaks[0]), breaks, np.full(degree, breaks[-1])))


def spline_curve(knots: FloatArray, weights: FloatArray, degree: int, integrate: Integrate) -> SplineCurve:
    """Return the curve of a spline with such knots, weights and degree."""
    origins, coefficients = _potential_above_zero(knots, weights, degree, integrate)
    pieces_above = origins.size
    if knots[0] < 0:
        mirrored_origins, mirrored_coefficients = _potential_above_zero(
            -knots[::-1], weights[::-1], degree, integrate
        )
        origins = np.concatenate((mirrored_origins[::-1], origins))
        coefficients = np.hstack((mirrored_coefficients[:, ::-1], coefficients))
    return SplineCurve(
        domain=(float(knots[0]), float(knots[-1])),
        pieces=(origins.size - pieces_above, pieces_above),
        origins=origins,
        coefficients=coefficients,
    )


def _potential_above_zero(
    knots: FloatArray, weights: FloatArray, degree: int, integrate: Integrate
) -> tuple[FloatArray, FloatArray]:
    """Return the origins of the potential's polynomials above zero, and their coefficients, ascending."""
    potential = integrate(_spline_above_zero(knots, weights, degree))
    return potential.x[:-1], potential.c[::-1]


def _spline_above_zero(knots: FloatArray, weights: FloatArray, degree: int) -> PPoly:
    """Return the spline from its knot at zero to the last; the other knots there enclose nothing."""
    spline = scipy.interpolate.PPoly.from_spline((knots, weights, degree))
    first = int(np.searchsorted(spline.x, 0.0, side="right")) - 1
    return scipy.interpolate.PPoly(spline.c[:, first:-degree], spline.x[first:-degree])


def times_deflection(curve: PPoly) -> PPoly:
    """Return the product phi curve(phi); each piece has its own origin."""
    coefficients = np.zeros((curve.c.shape[0] + 1, curve.c.shape[1]))
    coefficients[:-1] += curve.c
    coefficients[1:] += curve.c * curve.x[:-1]
    return scipy.interpolate.PPoly(coefficients, curve.x)
