"""A smooth curve through measured torques that keeps the shape of a hardening spring.

The slope zeta is written as phi g(phi) with g a cubic B-spline of non-negative coefficients, so that zeta has
the sign of phi whatever the data are; stiffness and torque are its integrals, with tau(0) = 0. The torque is
then piecewise polynomial, four times continuously differentiable, convex for phi > 0 and concave for phi < 0.
The coefficients and sigma(0) come from non-negative least squares.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vsacli.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

DEGREE = 3
MOST_PIECES = 24
"""Knot spans of g; a spring has no finer features than a few dozen measured points can show."""

LEAST_STIFFNESS = 1e-3
"""Share of its mean stiffness that a spring which pushes and pulls has at rest, since sigma > 0 is needed."""


@dataclass(frozen=True)
class MeasuredCurve:
    """A curve made of a half on either side of zero.

    Attributes:
        up: the half for positive deflections.
        down: the half for negative ones, turned around; that of a spring that only pulls is never asked.
        residual: the largest misfit in torque.
    """

    up: Half
    down: Half
    residual: float

    def __call__(self, order: int, phi: FloatArray) -> FloatArray:
        """Derivative of the torque of an order, from the energy (-1) to the curvature (3)."""
        size, below = np.abs(phi), phi < 0
        result = self.up(order, size)
        if below.any():
            result[below] = self.down(order, size[below])
        return result if order % 2 else np.copysign(result, phi)


class Half:
    """The curve over the size of the deflection, from zero on, so that nothing cancels near zero."""

    def __init__(self, spline: PPoly, stiffness_at_rest: float) -> None:
        slope = _times_deflection(spline)
        stiffness = slope.antiderivative()
        stiffness.c[-1] += stiffness_at_rest
        torque = stiffness.antiderivative()
        self._orders = {-1: torque.antiderivative(), 0: torque, 1: stiffness, 2: slope, 3: slope.derivative()}

    def __call__(self, order: int, size: FloatArray) -> FloatArray:
        """Derivative of the torque of an order."""
        return np.asarray(self._orders[order](size))


def fit_curve(deflection: FloatArray, torque: FloatArray) -> MeasuredCurve:
    """Fit torques (samples,) measured at ascending deflections (samples,), which begin at or below zero."""
    from scipy.optimize import nnls

    knots = _knots(float(deflection[0]), float(deflection[-1]), len(deflection))
    shapes = [_curve(knots, weights, 0.0) for weights in np.eye(len(knots) - DEGREE - 1)]
    columns = np.column_stack([deflection, *(shape(0, deflection) for shape in shapes)])
    sizes = np.abs(columns).max(axis=0)
    least = LEAST_STIFFNESS * np.ptp(torque) / np.ptp(deflection) if deflection[0] < 0 else 0.0
    excess, *weights = nnls(columns / sizes, torque - least * deflection)[0] / sizes
    curve = _curve(knots, np.array(weights), least + excess)
    return dataclasses.replace(curve, residual=float(np.abs(curve(0, deflection) - torque).max()))


def _knots(low: float, high: float, samples: int) -> FloatArray:
    """Knots of g, one of them at zero; about two measured points to a span."""
    pieces = int(np.clip(samples // 2, 1, MOST_PIECES))
    above = max(1, round(pieces * high / (high - low)))
    below = max(1, pieces - above) if low < 0 else 0
    breaks = np.concatenate((np.linspace(low, 0, below, endpoint=False), np.linspace(0, high, above + 1)))
    return np.concatenate((np.full(DEGREE, breaks[0]), breaks, np.full(DEGREE, breaks[-1])))


def _curve(knots: FloatArray, weights: FloatArray, stiffness_at_rest: float) -> MeasuredCurve:
    up = Half(_above_zero(knots, weights), stiffness_at_rest)
    down = Half(_above_zero(-knots[::-1], weights[::-1]), stiffness_at_rest)
    return MeasuredCurve(up, down, residual=math.nan)


def _above_zero(knots: FloatArray, weights: FloatArray) -> PPoly:
    """The spline from its knot at zero on; from the last knot, if that is zero, it is never asked."""
    from scipy.interpolate import PPoly

    whole = PPoly.from_spline((knots, weights, DEGREE))
    first = min(int(np.searchsorted(whole.x, 0.0, side="right")) - 1, whole.c.shape[1] - 1)
    return PPoly(whole.c[:, first:], whole.x[first:])


def _times_deflection(curve: PPoly) -> PPoly:
    """The product phi curve(phi); each piece has its own origin."""
    from scipy.interpolate import PPoly

    coefficients = np.zeros((curve.c.shape[0] + 1, curve.c.shape[1]))
    coefficients[:-1] += curve.c
    coefficients[1:] += curve.c * curve.x[:-1]
    return PPoly(coefficients, curve.x)
