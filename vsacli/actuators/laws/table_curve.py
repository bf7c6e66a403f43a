"""The curve of a table: smooth, through measured torques, with the shape of a hardening spring.

The slope zeta is written as phi g(phi) with g a cubic B-spline of non-negative coefficients, so that zeta has
the sign of phi whatever the data are; stiffness and torque are its integrals, with tau(0) = 0. The torque is
then piecewise polynomial, four times continuously differentiable, convex for phi > 0 and concave for phi < 0.
The coefficients and sigma(0) come from non-negative least squares.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vsacli.actuators.laws.spline_curve import SplineCurve, spline_curve, spline_knots, times_deflection
from vsacli.base.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

DEGREE = 3
MAX_PIECES = 24
"""Knot spans of g; a spring has no finer features than a few dozen measured points can show."""

REST_STIFFNESS_SHARE = 1e-3
"""Share of its mean stiffness that a spring which pushes and pulls has at rest, since sigma > 0 is needed."""

LEAST_SHAPE_SIZE = float(np.finfo(float).tiny)
"""Stands for the size of a shape that lies between two measured deflections and is zero at both."""


def fit_curve(deflection: FloatArray, torque: FloatArray) -> SplineCurve:
    """Fit torques (samples,) measured at ascending deflections (samples,), which begin at or below zero."""
    from scipy.optimize import nnls

    pieces = int(np.clip(len(deflection) // 2, 1, MAX_PIECES))
    knots = spline_knots(float(deflection[0]), float(deflection[-1]), pieces, DEGREE)
    shapes = [_curve(knots, weights, 0.0) for weights in np.eye(len(knots) - DEGREE - 1)]
    columns = np.column_stack([deflection, *(shape(deflection, 1, 1)[0] for shape in shapes)])
    sizes = np.maximum(np.abs(columns).max(axis=0), LEAST_SHAPE_SIZE)
    least = REST_STIFFNESS_SHARE * np.ptp(torque) / np.ptp(deflection) if deflection[0] < 0 else 0.0
    excess, *weights = nnls(columns / sizes, torque - least * deflection)[0] / sizes
    return _curve(knots, np.array(weights), least + excess)


def _curve(knots: FloatArray, weights: FloatArray, stiffness_at_rest: float) -> SplineCurve:
    """The energy of a spring with the slope phi g(phi)."""

    def energy(spline: PPoly) -> PPoly:
        stiffness = times_deflection(spline).antiderivative()
        stiffness.c[-1] += stiffness_at_rest
        return stiffness.antiderivative(2)

    return spline_curve(knots, weights, DEGREE, energy)
