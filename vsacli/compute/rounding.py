"""Tolerances that rounding sets: code for a coarser arithmetic than double precision needs larger ones."""

from __future__ import annotations

from typing import Self

import numpy as np

COARSER = float(np.finfo(np.float32).eps / np.finfo(np.float64).eps)
"""Rounding in single precision, relative to that in double precision."""


class OfRounding(float):
    """A tolerance for double precision, proportional to a power of the rounding of a number near 1.

    It computes as a float does, but recorded programs keep what it is.

    Attributes:
        power: the power; 1/2 where a step that converges quadratically takes what is left to rounding.
    """

    power: float

    def __new__(cls, value: float, power: float = 1.0) -> Self:
        """From the tolerance for double precision."""
        new = super().__new__(cls, value)
        new.power = power
        return new

    def in_single_precision(self) -> float:
        """The tolerance there."""
        return float(self * COARSER**self.power)
