"""The curve of a table: smooth, through measured torques, with the shape of a hardening spring.

The slope zeta is written as phi g(phi) with g a cubic B-spline of non-negative coefficients, so that zeta has
the sign of phi whatever the data are; stiffness and torque are its integrals, with tau(0) = 0. The torque is
then piecewise polynomial, four times continuously differentiable, convex for phi > 0 and concave for phi < 0.
The coefficients and sigma(0) come from non-negative least squares.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.compute.control_flow import Values, cell_of, look_up

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

DEGREE = 3
MAX_PIECES = 24
"""Knot spans of g; a spring has no finer features than a few dozen measured points can show."""

REST_STIFFNESS_SHARE = 1e-3
"""Share of its mean stiffness that a spring which pushes and pulls has at rest, since sigma > 0 is needed."""

LEAST_SHAPE_SIZE = float(np.finfo(float).tiny)
"""Stands for the size of a shape that lies between two measured deflections and is zero at both."""


@dataclass(frozen=True)
class MeasuredCurve:
    """A curve made of a half on either side of zero, over the size of the deflection.

    Attributes:
        domain: deflections at the ends.
        pieces: how many polynomials there are below zero, and above; in either half equally wide.
        origins: sizes of deflection from which the polynomials count, (pieces,); zero next to zero, so that
            nothing cancels there.
        coefficients: of the energy, from the constant on, (powers, pieces).
        residual: the largest misfit in torque.
    """

    domain: tuple[float, float]
    pieces: tuple[int, int]
    origins: FloatArray
    coefficients: FloatArray
    residual: float

    def __call__(self, phi: FloatArray, first: int, last: int) -> tuple[FloatArray, ...]:
        """Derivatives of the energy from one order, 0 or 1, to another, 4 at most."""
        origin, *coefficients = look_up(self._tables[first], self._piece(phi))
        sizes = _with_derivatives(coefficients, np.abs(phi) - origin, last - first)
        return tuple(np.copysign(size, phi) if order % 2 else size for order, size in enumerate(sizes, first))

    def _piece(self, phi: FloatArray) -> IndexArray:
        """The polynomial that holds; at an edge rounding may choose its neighbour, which is as good there."""
        (low, high), (below, above) = self.domain, self.pieces
        position = phi * (above / high)
        if below:
            steeper = below / -low > above / high
            position = below + (np.minimum if steeper else np.maximum)(position, phi * (below / -low))
        return cell_of(position, below + above)

    @cached_property
    def _tables(self) -> tuple[Values, Values]:
        """Origins with the coefficients of the energy, and with those of the torque, each over the pieces."""
        return (self.origins, *self._derivative(0)), (self.origins, *self._derivative(1))

    def _derivative(self, order: int) -> FloatArray:
        """Coefficients of a derivative of the energy, from the constant on, (powers, pieces)."""
        powers = range(order, len(self.coefficients))
        factors = np.array([math.perm(power, order) for power in powers], dtype=float)
        return factors[:, None] * self.coefficients[order:]


def _with_derivatives(coefficients: Sequence[FloatArray], x: FloatArray, order: int) -> list[FloatArray]:
    """A polynomial and its derivatives up to an order, by Horner's scheme repeated on the quotients."""
    *lower, highest = coefficients
    values = [highest]
    for coefficient in reversed(lower):
        top = values[-1]
        for power in range(len(values) - 1, 0, -1):
            values[power] = values[power] * x + values[power - 1]
        values[0] = values[0] * x + coefficient
        if len(values) <= order:
            values.append(top)
    return [math.factorial(power) * value if power > 1 else value for power, value in enumerate(values)]


def fit_curve(deflection: FloatArray, torque: FloatArray) -> MeasuredCurve:
    """Fit torques (samples,) measured at ascending deflections (samples,), which begin at or below zero."""
    from scipy.optimize import nnls

    knots = _knots(float(deflection[0]), float(deflection[-1]), len(deflection))
    shapes = [_curve(knots, weights, 0.0) for weights in np.eye(len(knots) - DEGREE - 1)]
    columns = np.column_stack([deflection, *(shape(deflection, 1, 1)[0] for shape in shapes)])
    sizes = np.maximum(np.abs(columns).max(axis=0), LEAST_SHAPE_SIZE)
    least = REST_STIFFNESS_SHARE * np.ptp(torque) / np.ptp(deflection) if deflection[0] < 0 else 0.0
    excess, *weights = nnls(columns / sizes, torque - least * deflection)[0] / sizes
    curve = _curve(knots, np.array(weights), least + excess)
    return dataclasses.replace(curve, residual=float(np.abs(curve(deflection, 1, 1)[0] - torque).max()))


def _knots(low: float, high: float, samples: int) -> FloatArray:
    """Knots of g, one of them at zero; about two measured points to a span."""
    pieces = int(np.clip(samples // 2, 1, MAX_PIECES))
    above = max(1, round(pieces * high / (high - low)))
    below = max(1, pieces - above) if low < 0 else 0
    breaks = np.concatenate((np.linspace(low, 0, below, endpoint=False), np.linspace(0, high, above + 1)))
    return np.concatenate((np.full(DEGREE, breaks[0]), breaks, np.full(DEGREE, breaks[-1])))


def _curve(knots: FloatArray, weights: FloatArray, stiffness_at_rest: float) -> MeasuredCurve:
    origins, coefficients = _half(knots, weights, stiffness_at_rest)
    above = origins.size
    if knots[0] < 0:
        down, turned = _half(-knots[::-1], weights[::-1], stiffness_at_rest)
        origins = np.concatenate((down[::-1], origins))
        coefficients = np.hstack((turned[:, ::-1], coefficients))
    return MeasuredCurve(
        domain=(float(knots[0]), float(knots[-1])),
        pieces=(origins.size - above, above),
        origins=origins,
        coefficients=coefficients,
        residual=math.nan,
    )


def _half(knots: FloatArray, weights: FloatArray, stiffness_at_rest: float) -> tuple[FloatArray, FloatArray]:
    """Origins of the energy's polynomials above zero, and their coefficients from the constant on."""
    energy = _energy(_above_zero(knots, weights), stiffness_at_rest)
    return energy.x[:-1], energy.c[::-1]


def _energy(spline: PPoly, stiffness_at_rest: float) -> PPoly:
    """Energy over the size of the deflection, of the spring with the slope phi spline(phi)."""
    stiffness = _times_deflection(spline).antiderivative()
    stiffness.c[-1] += stiffness_at_rest
    return stiffness.antiderivative(2)


def _above_zero(knots: FloatArray, weights: FloatArray) -> PPoly:
    """The spline from its knot at zero to the last; the other knots there enclose nothing."""
    from scipy.interpolate import PPoly

    whole = PPoly.from_spline((knots, weights, DEGREE))
    first = int(np.searchsorted(whole.x, 0.0, side="right")) - 1
    return PPoly(whole.c[:, first:-DEGREE], whole.x[first:-DEGREE])


def _times_deflection(curve: PPoly) -> PPoly:
    """The product phi curve(phi); each piece has its own origin."""
    from scipy.interpolate import PPoly

    coefficients = np.zeros((curve.c.shape[0] + 1, curve.c.shape[1]))
    coefficients[:-1] += curve.c
    coefficients[1:] += curve.c * curve.x[:-1]
    return PPoly(coefficients, curve.x)
