"""Roots of increasing functions with two known derivatives: Halley's method in a shrinking bracket."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, repeat
from vsacli.compute.rounding import OfRounding

Function = Callable[..., Values]
"""Value, slope and curvature at (x, *constants), arrays of one shape."""

MAX_STEPS = 100
"""Halvings leave no digit after 60; between them Halley's method takes a handful of steps."""

SHORT_STEP = OfRounding(1e-5, power=1 / 3)
"""Step, relative to x, after which the third power of it is rounding."""

LEFT_ERROR = OfRounding(1e-17)
"""Error after a step, relative to x, that is below rounding: Newton's step times Halley's correction squared.
Where the slope vanishes, as next to a fold, steps that are short enough elsewhere are not."""


def increasing_root(
    function: Function, low: FloatArray, high: FloatArray, start: FloatArray, constants: Values
) -> FloatArray:
    """The x between `low` and `high` at which a function is zero, to rounding; an end if it has no zero.

    Args:
        function: what increases between both.
        low: the smaller ends, (samples,).
        high: the larger ends.
        start: first guesses; the middle is taken where they do not lie between both.
        constants: what else the function takes, arrays (samples,).
    """

    def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
        x, low, high = state
        value, slope, curvature = function(x, *constants)
        newton = value / slope
        correction = newton * curvature / (2 * slope)
        target = x - newton / np.minimum(np.maximum(1 - correction, 0.5), 2)
        low, high = np.where(value <= 0, x, low), np.where(value >= 0, x, high)
        inside = (low <= target) & (target <= high)
        following = np.where(inside, target, (low + high) / 2)
        size = np.abs(following)
        error = np.abs(newton) * (correction * correction)
        short = (np.abs(newton) <= SHORT_STEP * size) & (error <= LEFT_ERROR * size)
        return (following, low, high), inside & short | ~(low < high)

    with np.errstate(all="ignore"):  # without slope, a step leads nowhere
        first = np.where((low < start) & (start < high), start, (low + high) / 2)
        return repeat(step, (first, low, high), constants, MAX_STEPS)[0]
