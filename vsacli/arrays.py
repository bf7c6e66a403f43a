"""Array types, and the memory layout used throughout.

Arrays over time have the shape (samples, joints) or (samples, joints, 2) for the user, and are laid out with
the samples contiguous (`over_time` and `by_joint` change the view, not the memory), because every operation
runs along the samples of one joint.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
FlagArray = npt.NDArray[np.uint16]
IndexArray = npt.NDArray[np.intp]


def over_time(rows: FloatArray) -> FloatArray:
    """View (joints, samples) as (samples, joints), or (joints, 2, samples) as (samples, joints, 2)."""
    return np.moveaxis(rows, -1, 0)


def by_joint(array: npt.ArrayLike) -> FloatArray:
    """The inverse of `over_time`, with contiguous samples; copies only an array laid out otherwise."""
    return np.ascontiguousarray(np.moveaxis(np.asarray(array, dtype=np.float64), 0, -1))
