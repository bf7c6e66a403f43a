"""What an implicit method needs of stiff equations of motion: their Jacobian, and what rounding allows."""

from __future__ import annotations

import math

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.control.simulation.budget import Derivative

_EPSILON = float(np.finfo(np.float64).eps)
_RELATIVE_STEP = math.sqrt(_EPSILON)
"""Of forward differences: where truncation and rounding are alike."""


def jacobian(function: Derivative, time: float, vector: FloatArray) -> FloatArray:
    """Derivative of a function of time and state by the state, (values, entries), by forward differences.

    Where a difference steps over the end of a spring's law the entry is zero: Newton's iteration becomes
    slower by that, and not wrong.
    """
    steps = _RELATIVE_STEP * np.maximum(np.abs(vector), 1.0)
    rows = function(time, np.vstack((vector, vector + np.diag(steps))))
    columns = (rows[1:] - rows[0]) / steps[:, None]
    return np.where(np.isfinite(columns), columns, 0.0).T


def rounding(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """What rounding of the state may change a function by, (values,), from its Jacobian (values, entries)."""
    changes: FloatArray = _EPSILON * (np.abs(matrix) @ np.maximum(np.abs(vector), 1.0))
    return changes


def resolved(matrix: FloatArray, vector: FloatArray, rtol: float) -> FloatArray:
    """Smallest absolute tolerances (entries,) that rounding allows an implicit method with such a Jacobian.

    Rounding makes rates of the fastest mode uncertain, and the mode forgets within 1/|lambda|. Newton's
    iteration stops at a share of sqrt(rtol) of the tolerance (`Radau` of SciPy), which must not lie below.
    """
    fastest = float(np.abs(np.linalg.eigvals(matrix)).max(initial=1.0))
    return rounding(matrix, vector) / (fastest * math.sqrt(rtol))
