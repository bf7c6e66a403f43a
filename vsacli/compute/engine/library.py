"""Recorded programs as loaded machine code."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import FloatArray
from vsacli.compute.engine.compiler import CompilerError

SAMPLES_PER_THREAD = 2048
"""Fewer are not worth a thread."""

VECTOR = 8
"""Doubles in the longest vector, and in a line of the processor's cache."""


class Library:
    """A compiled program.

    Args:
        path: of the shared library; it may be removed once loaded.
        outputs: rows that the program computes.

    Raises:
        CompilerError: it cannot be loaded.
    """

    def __init__(self, path: Path, outputs: int) -> None:
        self._outputs = outputs
        try:
            self._run = ctypes.CDLL(str(path)).run
        except (OSError, AttributeError) as error:
            raise CompilerError(f"what the C compiler made cannot be loaded: {error}") from None
        self._run.argtypes = [ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p]
        self._run.restype = None

    def __call__(self, rows: Sequence[FloatArray], threads: int) -> FloatArray:
        """Run on rows (samples,) of doubles, contiguous; the outputs, (rows, samples)."""
        samples = len(rows[0])
        outputs = _aligned(self._outputs, samples)
        sources = np.array([_address(row) for row in rows], dtype=np.uintp)
        targets = _address(outputs) + np.arange(self._outputs, dtype=np.uintp) * np.uintp(outputs.strides[0])
        given = _address(sources), _address(targets)
        count = min(threads, max(1, samples // SAMPLES_PER_THREAD))
        own, *others = _parts(samples, count)
        running = [_pool(count - 1).submit(self._run, *part, *given) for part in others]
        self._run(*own, *given)
        for part in running:
            part.result()
        return outputs


@lru_cache(maxsize=1)
def _pool(threads: int) -> ThreadPoolExecutor:
    """Threads beside the calling one; they last as long as the process."""
    return ThreadPoolExecutor(threads)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a child process has none of the threads


def _aligned(rows: int, samples: int) -> FloatArray:
    """Space for rows that each begin at a whole vector.

    They are an odd number of vectors apart: at a power of two, all would fall into the same sets of a cache.
    """
    distance = VECTOR * (samples // VECTOR // 2 * 2 + 3)
    space = np.empty(rows * distance + VECTOR)
    first = -(_address(space) // space.itemsize) % VECTOR
    return space[first : first + rows * distance].reshape(rows, distance)[:, :samples]


def _address(array: npt.NDArray[Any]) -> int:
    """Of its first entry."""
    address: int = array.__array_interface__["data"][0]
    return address


def _parts(samples: int, count: int) -> list[tuple[int, int]]:
    """From where to where each thread computes; whole vectors, but for the last."""
    ends = [VECTOR * (samples * number // count // VECTOR) for number in range(count)]
    return list(pairwise([*ends, samples]))
