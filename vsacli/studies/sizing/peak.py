"""The largest size of something over several motions, and when it is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.json_records import Published


@dataclass(frozen=True)
class Peak(Published):
    """The largest size of something, and when it is; NaN if it never exists.

    Attributes:
        value: the size.
        trajectory: its name.
        time: in it, s.
    """

    value: float = math.nan
    trajectory: str = ""
    time: float = math.nan

    @classmethod
    def of(cls, values: FloatArray, time: FloatArray, trajectory: str) -> Self:
        """Of those values that exist, each (samples,)."""
        sizes = np.where(np.isfinite(values), np.abs(values), -1.0)
        step = int(sizes.argmax())
        return cls(float(sizes[step]), trajectory, float(time[step])) if sizes[step] >= 0 else cls()

    def or_larger(self, other: Self) -> Self:
        """The larger one of both."""
        return self if self.value >= other.value or math.isnan(other.value) else other
