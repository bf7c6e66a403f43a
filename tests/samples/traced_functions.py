"""Functions that are traced: operations on values of any kind, and loops, branches and tables."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from vsacli.compute.control_flow import cell_of, look_up, repeat, where_needed

SPECIAL = [0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, 1e308, 1.0, -1.0]
"""Where functions have their limits, poles, and ends."""

NODES = np.array([-1.0, 0.0, 0.5, 2.0])


def of_one(ufunc: np.ufunc) -> Callable[[Any, Any], Any]:
    return lambda x, _y: ufunc(x)


ELEMENTWISE: dict[str, Callable[[Any, Any], Any]] = {
    **{
        name: of_one(getattr(np, name))
        for name in (
            *("negative", "positive", "absolute", "fabs", "square", "reciprocal", "sqrt", "cbrt"),
            *("exp", "expm1", "log", "log1p", "sin", "cos", "tan", "arcsin", "arccos", "arctan"),
            *("sinh", "cosh", "tanh", "arcsinh", "isnan", "isfinite", "isinf"),
        )
    },
    **{
        name: getattr(np, name)
        for name in (
            *("add", "subtract", "multiply", "divide", "maximum", "minimum", "power", "arctan2"),
            *("hypot", "copysign", "less", "less_equal", "greater", "greater_equal", "equal", "not_equal"),
        )
    },
    "operators": lambda x, y: 2 * x - y / 3 + (-x) * (1 - y) + 4 / x,
    "small powers": lambda x, _y: x**2,
    "and": lambda x, y: (x < y) & (y > 0),
    "or": lambda x, y: (x < y) | np.isnan(y),
    "not": lambda x, y: ~(x < y),
    "logical functions": lambda x, y: np.logical_and(x < y, np.logical_not(np.isnan(y))),
    "where": lambda x, y: np.where(x < y, x, 2.0),
    "where of truths": lambda x, y: np.where(x < y, x < 0, np.isnan(y)),
    "clip": lambda x, _y: np.clip(x, -0.5, 2.0),
    "clip between values": lambda x, y: np.clip(x, y, 2 * y),
    "search": lambda x, _y: np.searchsorted(NODES, x, side="right"),
    "bits": lambda x, y: (x < y).astype(np.uint32) * np.uint32(4) | (y < 0).astype(np.uint32) * np.uint32(16),
    "any": lambda x, y: np.logical_or.reduce(np.stack([x < y, y < 0])),
    "hypot of NaN": lambda x, _y: np.hypot(x, np.nan),
    "sign of NaN": lambda x, _y: np.copysign(x, np.nan),
    "power of NaN": lambda x, _y: np.power(x, np.nan),
}


def operands() -> tuple[np.ndarray, np.ndarray]:
    """Every pair of special values, and some random ones of any size."""
    rng = np.random.default_rng(0)
    x, y = (grid.ravel() for grid in np.meshgrid(SPECIAL, SPECIAL))
    drawn = rng.normal(size=(2, 200)) * 10.0 ** rng.integers(-3, 4, (2, 200))
    return np.concatenate([x, drawn[0]]), np.concatenate([y, drawn[1]])


TABLE = np.array([3.0, -1.0, 0.5, np.inf, 8.0])


def square_root(x: Any) -> Any:
    """Newton's method from above; samples need different numbers of steps."""

    def step(state: Any, constants: Any) -> Any:
        (root, count), (x,) = state, constants
        following = 0.5 * (root + x / root)
        return (following, count + 1), np.abs(following - root) <= 1e-15 * following

    return list(repeat(step, (np.maximum(x, 1.0), np.zeros_like(x)), (x,), 12))


def swapped(x: Any) -> Any:
    """Every step reads both old values before either is replaced."""

    def step(state: Any, _constants: Any) -> Any:
        a, b = state
        return (b, a + b), b > 30

    return list(repeat(step, (x, 2 * x), (), 9))


def handed_down(x: Any) -> Any:
    """Only the first entry of the state is looked at, which gets the last one's values two steps later."""

    def step(state: Any, constants: Any) -> Any:
        (first, second, third, idle), (x,) = state, constants
        return (second, third, 2 * third + x, idle + first), first > 40

    first, *_ = repeat(step, (x, x + 1, x + 2, x), (x,), 8)
    return first


def half_used(x: Any) -> Any:
    """The first of two results is not looked at."""
    _, second = where_needed(x > 1, lambda y, z: (np.sqrt(y), y * z), (x, x + 3), (x, -x))
    return second


def guarded(x: Any) -> Any:
    """A function that is only called where it has a value."""
    return list(where_needed(x > 1, lambda y: (np.log(y), y * y), (x,), (-x, np.full_like(x, 7.0))))


def nested(x: Any) -> Any:
    """A branch in a loop in a branch."""

    def step(state: Any, constants: Any) -> Any:
        (value,), (x,) = state, constants
        (halved,) = where_needed(value > 3, lambda v: (v / 2,), (value,), (value + 0.25,))
        return (halved,), halved > x

    def function(y: Any) -> Any:
        return repeat(step, (y + 1,), (y,), 6)

    return list(where_needed(np.isfinite(x), function, (x,), (np.full_like(x, np.nan),)))


def partly_used(x: Any) -> Any:
    """Of the three results of a loop in a branch one is not looked at inside of it, and one not outside."""

    def step(state: Any, constants: Any) -> Any:
        (halved, idle, total), (x,) = state, constants
        return (halved / 2, idle - x, total + halved), halved < 1

    def function(y: Any) -> Any:
        halved, _, total = repeat(step, (y, y, y + 1), (y,), 9)
        return halved, total

    _, total = where_needed(np.isfinite(x), function, (x,), (x, x))
    return total


def counted(x: Any) -> Any:
    """Cells of one width."""
    (found,) = look_up((TABLE,), cell_of(np.where(np.isnan(x), 0.0, x), len(TABLE)))
    return found


def interpolated(x: Any) -> Any:
    """A table whose place is searched for, and clipped."""
    index = np.clip(np.searchsorted(NODES, x, side="right") - 1, 0, len(NODES) - 2)
    value, node = look_up((TABLE, NODES), index)
    (following,) = look_up((TABLE,), index + 1)
    return value + following * (x - node)


def interpolated_at_a_constant(x: Any) -> Any:
    """A place that does not depend on the sample."""
    return x + interpolated(np.full_like(x, 0.3))


CONTROL_FLOW = (
    square_root,
    swapped,
    handed_down,
    half_used,
    guarded,
    nested,
    partly_used,
    counted,
    interpolated,
    interpolated_at_a_constant,
)
"""Functions of one value with loops, branches and tables."""
