"""Array types, and the memory layout used throughout.

Public arrays over time have the shape (samples, joints) or (samples, joints, 2). Their samples are contiguous
in memory (`over_time` and `by_joint` change the view, not the memory), because every operation runs along the
samples of one joint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vsacli.base.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike  # numpy.typing takes as long to import as all of this package's types

FLAG_TYPE = np.uint32
"""Type of flags in arrays and files."""

_AnyShape = tuple[Any, ...]
FloatArray = np.ndarray[_AnyShape, np.dtype[np.float64]]
BoolArray = np.ndarray[_AnyShape, np.dtype[np.bool_]]
FlagArray = np.ndarray[_AnyShape, np.dtype[FLAG_TYPE]]
IndexArray = np.ndarray[_AnyShape, np.dtype[np.intp]]
AnyArray = np.ndarray[_AnyShape, np.dtype[Any]]


def over_time(rows: FloatArray) -> FloatArray:
    """View (joints, samples) as (samples, joints), or (joints, 2, samples) as (samples, joints, 2)."""
    return rows.transpose(rows.ndim - 1, *range(rows.ndim - 1))


def by_joint(array: ArrayLike) -> FloatArray:
    """Invert `over_time`; the samples are contiguous, and copied only if the memory layout differs."""
    values = np.asarray(array, dtype=np.float64)
    return np.ascontiguousarray(values.transpose(*range(1, values.ndim), 0))


def contiguous_rows(rows: FloatArray) -> FloatArray:
    """Return rows, (rows, samples), each of which is contiguous; copy only where they are not."""
    return rows if rows.strides[-1] == rows.itemsize else np.ascontiguousarray(rows)


def stack_constants(constants: Sequence[Any]) -> AnyArray:
    """Return constants along a first axis that broadcast with samples along a second.

    The shape is (constants, 1), or (constants, samples) if a constant is a row with a value for each sample.
    """
    row = next((constant for constant in constants if np.ndim(constant)), None)
    if row is None:
        stacked: AnyArray = np.stack(constants)[:, None]
    else:
        stacked = np.stack([each if np.ndim(each) else np.full_like(row, each) for each in constants])
    return stacked


def checked_shape(name: str, array: ArrayLike, *shape: int) -> FloatArray:
    """Return the array as float64 if it has this shape, or this shape after an axis of samples.

    Raises:
        InputError: the shape differs, or an element is not a number.
    """
    try:
        values = np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError.one(f"{name} must be an array of numbers: {error}") from None
    if values.shape != shape and (values.ndim != len(shape) + 1 or values.shape[1:] != shape):
        expected = ", ".join(map(str, shape))
        raise InputError.one(
            f"{name} must have the shape ({expected}) or (samples, {expected}), not {values.shape}"
        )
    return values


def evenly(length: int, count: int) -> IndexArray:
    """Return at most `count` evenly spaced indices of `length`, both ends included."""
    return np.linspace(0, length - 1, min(length, count)).round().astype(np.intp)


def of_joint(arrays: Mapping[str, AnyArray], index: int) -> dict[str, AnyArray]:
    """Return views (samples,) or (2, samples) of one joint's part of arrays (samples, joints[, 2])."""
    return {name: array[:, index].T for name, array in arrays.items()}
