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
        (f,) = subroutine(lambda *known: (function(*known),), (x, *constants))
        return f

    def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
        share, x_1, f_1, x_2, f_2, _, _ = state
        x = x_1 + share * (x_2 - x_1)
        f = value(x, *constants)
        same = (f > 0) == (f_1 > 0)
        x_3, f_3 = np.where(same, x_1, x_2), np.where(same, f_1, f_2)
        x_2, f_2 = np.where(same, x_2, x_1), np.where(same, f_2, f_1)
        width = np.abs(x_2 - x)
        resolution = ROOT_RTOL * np.minimum(np.abs(x), np.abs(x_2)) + ROOT_ATOL
        least = resolution / np.maximum(width, ROOT_ATOL)
        share = np.clip(_next_share(x, f, x_2, f_2, x_3, f_3), least, 1 - least)
        return (share, x, f, x_2, f_2, x_3, f_3), (width <= 2 * resolution) | (f == 0)

    at_low, at_high = value(low, *constants), value(high, *constants)
    half = np.full_like(low, 0.5)
    start = (half, low, at_low, high, at_high, high, at_high)
    _, x_1, f_1, x_2, f_2, _, _ = repeat(step, start, constants, MAX_STEPS)
    enclosed = (at_low < 0) & (at_high > 0) | (at_low > 0) & (at_high < 0)
    end = np.where(np.abs(at_low) <= np.abs(at_high), low, high)
    return np.where(enclosed, np.where(np.abs(f_1) <= np.abs(f_2), x_1, x_2), end)


def _next_share(
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
