"""Tolerances in proportion to rounding, so that code in single precision gets larger ones."""

from __future__ import annotations

import math
from typing import Self

import numpy as np

COARSER = float(np.finfo(np.float32).eps / np.finfo(np.float64).eps)
"""Rounding in single precision, relative to that in double precision."""

_SMALLEST, _LARGEST = float(np.finfo(np.float32).tiny), float(np.finfo(np.float32).max)


class OfRounding(float):
    """A tolerance for double precision, proportional to a power of the rounding of a number near 1.

    It behaves as a float, but programs keep its type, from which `single` derives the larger tolerance.

    Attributes:
        power: Power; 1/2 for a step whose square is rounding, since the method converges quadratically.
    """

    power: float

    def __new__(cls, value: float, power: float = 1.0) -> Self:
        """Return a tolerance with this value in double precision."""
        new = super().__new__(cls, value)
        new.power = power
        return new

    def in_single_precision(self) -> float:
        """Return the tolerance for single precision."""
        return float(self * COARSER**self.power)


def single(number: float) -> float:
    """Return a constant for single precision: a larger tolerance, and zero only for zero."""
    if isinstance(number, OfRounding):
        number = number.in_single_precision()
    if number and abs(number) < _SMALLEST:
        return math.copysign(_SMALLEST, number)
    return math.copysign(math.inf, number) if abs(number) > _LARGEST else number
