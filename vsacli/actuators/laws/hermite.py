"""Hermite's cubic, by which first guesses are interpolated between nodes."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray


def hermite(
    x: FloatArray, low: FloatArray, high: FloatArray, start: FloatArray, end: FloatArray
) -> FloatArray:
    """The cubic over x from 0 to 1 with values and slopes at both ends; arrays of one shape."""
    rise = high - low
    return low + x * (start + x * (3 * rise - 2 * start - end + x * (start + end - 2 * rise)))


def in_single(values: FloatArray) -> FloatArray:
    """Values with the digits of single precision, which do for a guess; beyond its range as they are."""
    with np.errstate(all="ignore"):
        rounded = values.astype(np.float32).astype(float)
    return np.where(np.isfinite(rounded) & ((rounded == 0) == (values == 0)), rounded, values)
