"""Rows of samples aligned in memory for vector registers and caches."""

from __future__ import annotations

import ctypes

import numpy as np

from vsacli.base.arrays import AnyArray

LINE = 64
"""Bytes of the longest vector register, and of a cache line."""


def aligned_rows(rows: int, samples: int, dtype: type[np.generic] = np.float64) -> AnyArray:
    """Return uninitialized rows, (rows, samples), each of which begins at a multiple of `LINE` bytes.

    Rows are an odd number of lines apart: at a power of two, all would be in the same sets of a cache.
    """
    size = np.dtype(dtype).itemsize
    distance = LINE * (samples * size // LINE // 2 * 2 + 3)
    space = np.empty(rows * distance + LINE, dtype=np.uint8)
    first = -address(space) % LINE
    return space[first : first + rows * distance].view(dtype).reshape(rows, distance // size)[:, :samples]


def address(array: AnyArray) -> int:
    """Return the memory address of the first entry; by the buffer it takes a third of the time."""
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(array.data))
    except (TypeError, ValueError):  # the array is read-only, not contiguous or empty
        return int(array.__array_interface__["data"][0])
