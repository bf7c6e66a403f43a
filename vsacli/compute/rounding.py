"""Tolerances in proportion to rounding, so that code in single precision gets larger ones."""

from __future__ import annotations

import math
from typing import Self

import numpy as np

COARSER = float(np.finfo(np.float32).eps / np.finfo(np.float64).eps)
"""Rounding in single precision, relative to that in double precision."""

_SINGLE_TINY, _SINGLE_MAX = float(np.finfo(np.float32).tiny), float(np.finfo(np.float32).max)


class OfRounding(float):
    """A tolerance for double precision, proportional to a power of the rounding of a number near 1.

    It behaves as a float, but programs keep its type, from which `single_constant` derives the larger
    tolerance.

    Attributes:
        power: Power; 1/2 for a step whose square is rounding, since the method converges quadratically.
    """

    power: float

    def __new__(cls, value: float, power: float = 1.0) -> Self:
        """Return a tolerance with this value in double precision."""
        tolerance = super().__new__(cls, value)
        tolerance.power = power
        return tolerance

    def single_precision_value(self) -> float:
        """Return the tolerance for single precision."""
        return float(self * COARSER**self.power)


def single_constant(constant: float) -> float:
    """Return a constant for single precision: a larger tolerance, and zero only for zero."""
    if isinstance(constant, OfRounding):
        constant = constant.single_precision_value()
    if constant and abs(constant) < _SINGLE_TINY:
        return math.copysign(_SINGLE_TINY, constant)
    return math.copysign(math.inf, constant) if abs(constant) > _SINGLE_MAX else constant
