"""Recorded programs as loaded machine code."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path

import numpy as np

from vsacli.arrays import FloatArray
from vsacli.engine.compiler import CompilerError

SAMPLES_PER_THREAD = 1024
"""Fewer are not worth a thread."""


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
        rows = ctypes.POINTER(ctypes.c_void_p)
        try:
            self._run = ctypes.CDLL(str(path)).run
        except (OSError, AttributeError) as error:
            raise CompilerError(f"what the C compiler made cannot be loaded: {error}") from None
        self._run.argtypes = [ctypes.c_int64, ctypes.c_int64, rows, rows]
        self._run.restype = None

    def __call__(self, rows: Sequence[FloatArray], threads: int) -> FloatArray:
        """Run on rows (samples,) of doubles, contiguous; the outputs, (rows, samples)."""
        samples = len(rows[0])
        outputs = np.empty((self._outputs, samples))
        sources, targets = _addresses(rows), _addresses(outputs)
        parts = _parts(samples, min(threads, max(1, samples // SAMPLES_PER_THREAD)))
        if len(parts) == 1:
            self._run(*parts[0], sources, targets)
        else:
            with ThreadPoolExecutor(len(parts)) as pool:
                list(pool.map(lambda part: self._run(*part, sources, targets), parts))
        return outputs


def _addresses(rows: Iterable[FloatArray]) -> ctypes.Array[ctypes.c_void_p]:
    addresses = [row.ctypes.data for row in rows]
    return (ctypes.c_void_p * len(addresses))(*addresses)


def _parts(samples: int, count: int) -> list[tuple[int, int]]:
    ends = np.linspace(0, samples, count + 1).astype(int).tolist()
    return list(pairwise(ends))
