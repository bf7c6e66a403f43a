"""Roots between two ends by Chandrupatla's method: inverse quadratic interpolation guarded by bisection."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, repeat, subroutine
from vsacli.compute.rounding import OfRounding

Function = Callable[..., FloatArray]
"""f(x, *constants) on arrays of one shape."""

MAX_STEPS = 120
"""Largest number of steps: twice as many as bisection needs between adjacent powers of two. Brackets with an
end at zero may need more."""

ROOT_RTOL = OfRounding(2 * np.finfo(float).eps)
"""Relative width of a bracket that cannot be halved any more."""

ROOT_ATOL = 1e-300
"""Absolute width of such a bracket at zero."""


def bracketed_root(
    function: Function, low: FloatArray, high: FloatArray, constants: Values = ()
) -> FloatArray:
    """Return a root between `low` and `high`, where the function has opposite signs, to rounding.

    If the signs are equal, return the end at which the function is nearer to zero.

    T. R. Chandrupatla, A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear
    function without using derivatives, Advances in Engineering Software 28 (1997). Arrays (samples,).
    """

    def value(x: FloatArray, *constants: FloatArray) -> FloatArray:
        (f,) = subroutine(lambda *arguments: (function(*arguments),), (x, *constants))
        return f

    def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
        share, x_1, f_1, x_2, f_2, _, _ = state
        x = x_1 + share * (x_2 - x_1)
        f = value(x, *constants)
        same_sign = (f > 0) == (f_1 > 0)
        x_3, f_3 = np.where(same_sign, x_1, x_2), np.where(same_sign, f_1, f_2)
        x_2, f_2 = np.where(same_sign, x_2, x_1), np.where(same_sign, f_2, f_1)
        width = np.abs(x_2 - x)
        resolution = ROOT_RTOL * np.minimum(np.abs(x), np.abs(x_2)) + ROOT_ATOL
        smallest_share = resolution / np.maximum(width, ROOT_ATOL)
        share = np.clip(_interpolated_share(x, f, x_2, f_2, x_3, f_3), smallest_share, 1 - smallest_share)
        return (share, x, f, x_2, f_2, x_3, f_3), (width <= 2 * resolution) | (f == 0)

    f_low, f_high = value(low, *constants), value(high, *constants)
    half_share = np.full_like(low, 0.5)
    start = (half_share, low, f_low, high, f_high, high, f_high)
    _, x_1, f_1, x_2, f_2, _, _ = repeat(step, start, constants, MAX_STEPS)
    is_bracketed = (f_low < 0) & (f_high > 0) | (f_low > 0) & (f_high < 0)
    nearer_end = np.where(np.abs(f_low) <= np.abs(f_high), low, high)
    return np.where(is_bracketed, np.where(np.abs(f_1) <= np.abs(f_2), x_1, x_2), nearer_end)


def _interpolated_share(
    x_1: FloatArray, f_1: FloatArray, x_2: FloatArray, f_2: FloatArray, x_3: FloatArray, f_3: FloatArray
) -> FloatArray:
    """Return the next point, as a share of the way from x_1 to x_2.

    Inverse quadratic interpolation if the parabola through the three points is monotone, else bisection.
    """
    with np.errstate(all="ignore"):
        xi, phi = (x_1 - x_2) / (x_3 - x_2), (f_1 - f_2) / (f_3 - f_2)
        monotone = (phi * phi < xi) & ((1 - phi) * (1 - phi) < 1 - xi)
        parabola = f_1 / (f_2 - f_1) * f_3 / (f_2 - f_3) + (x_3 - x_1) / (x_2 - x_1) * f_1 / (
            f_3 - f_1
        ) * f_2 / (f_3 - f_2)
    return np.where(monotone, parabola, 0.5)
