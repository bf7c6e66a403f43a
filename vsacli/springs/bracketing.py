"""SciPy's vectorised bracketing methods, imported at first use: runs with closed forms do not need SciPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vsacli.arrays import FloatArray

Function = Callable[..., FloatArray]
"""f(x, *arguments) on arrays of one shape."""


def bracketed_root(
    function: Function, low: FloatArray, high: FloatArray, *arguments: FloatArray
) -> FloatArray:
    """A root between `low` and `high`, where the function has opposite signs, to rounding (Chandrupatla)."""
    from scipy.optimize import elementwise

    find_root: Any = elementwise.find_root
    root: FloatArray = find_root(function, (low, high), args=arguments).x
    return root


def bracketed_minimum(
    function: Function, low: FloatArray, middle: FloatArray, high: FloatArray, *arguments: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Position and value of a minimum between `low` and `high`, where `middle` lies below both ends."""
    from scipy.optimize import elementwise

    find_minimum: Any = elementwise.find_minimum
    result = find_minimum(function, (low, middle, high), args=arguments)
    return result.x, result.f_x
