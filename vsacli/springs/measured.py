"""A smooth curve through measured torques that keeps the shape of a hardening spring.

The slope zeta is written as phi g(phi) with g a cubic B-spline of non-negative coefficients, so that zeta has
the sign of phi whatever the data are; stiffness and torque are its integrals, with tau(0) = 0. The torque is
then piecewise polynomial, four times continuously differentiable, convex for phi > 0 and concave for phi < 0.
The coefficients and sigma(0) come from non-negative least squares.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsacli.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

DEGREE = 3
MOST_PIECES = 24
"""Knot spans of g; a spring has no finer features than a few dozen measured points can show."""


class MeasuredCurve(NamedTuple):
    """Torque, its integral and its derivatives; `residual` is the largest misfit in torque."""

    energy: PPoly
    torque: PPoly
    stiffness: PPoly
    slope: PPoly
    curvature: PPoly
    residual: float


def fit_curve(deflection: FloatArray, torque: FloatArray) -> MeasuredCurve:
    """Fit torques (samples,) measured at ascending deflections (samples,), which begin at or below zero."""
    from scipy.interpolate import PPoly
    from scipy.optimize import nnls

    pieces = int(np.clip(len(deflection) // 2, 1, MOST_PIECES))
    breaks = np.linspace(deflection[0], deflection[-1], pieces + 1)
    knots = np.concatenate((np.full(DEGREE, breaks[0]), breaks, np.full(DEGREE, breaks[-1])))
    shapes = [_times_deflection(PPoly.from_spline((knots, row, DEGREE))) for row in np.eye(pieces + DEGREE)]
    torques = [_from_zero(_from_zero(shape)) for shape in shapes]
    columns = np.column_stack([deflection, *(part(deflection) for part in torques)])
    sizes = np.abs(columns).max(axis=0)
    stiffness_at_rest, *weights = nnls(columns / sizes, torque)[0] / sizes

    slope = PPoly(sum(weight * shape.c for weight, shape in zip(weights, shapes, strict=True)), shapes[0].x)
    stiffness = _from_zero(slope, stiffness_at_rest)
    fitted = _from_zero(stiffness)
    residual = float(np.abs(fitted(deflection) - torque).max())
    return MeasuredCurve(_from_zero(fitted), fitted, stiffness, slope, slope.derivative(), residual)


def _times_deflection(curve: PPoly) -> PPoly:
    """The product phi curve(phi); each piece has its own origin."""
    from scipy.interpolate import PPoly

    coefficients = np.zeros((curve.c.shape[0] + 1, curve.c.shape[1]))
    coefficients[:-1] += curve.c
    coefficients[1:] += curve.c * curve.x[:-1]
    return PPoly(coefficients, curve.x)


def _from_zero(curve: PPoly, value: float = 0.0) -> PPoly:
    """The integral of a curve that has a value at zero deflection."""
    integral = curve.antiderivative()
    integral.c[-1] += value - integral(0.0)
    return integral
