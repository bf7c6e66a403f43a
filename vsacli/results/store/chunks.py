"""Samples on their way into the chunks of a dataset.

The library would copy each block into chunks of its own, look every chunk up, and keep in its cache what is
not full. Here a chunk is put together in the order in which it is stored, with one copy, and written whole.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from functools import partial

import h5py
import numpy as np

from vsacli.base.arrays import AnyArray

CHUNK_BYTES = 2**19
"""Size of a chunk, at most. Of 64 kB to 1 MB tried, those from 256 kB on take the same time; smaller ones
cost time for each chunk, larger ones memory for each variable."""

HandOver = Callable[[Callable[[], None], int], None]
"""Takes what is to be done with a chunk, and the bytes that it keeps till then."""


def chunk_rows(samples: int, row_bytes: int) -> int:
    """Samples in a chunk: equal chunks, as few as `CHUNK_BYTES` allows."""
    most = max(1, CHUNK_BYTES // row_bytes)
    chunks = -(-samples // most)
    return -(-samples // chunks)


class ChunkFiller:
    """Appends samples to a dataset, chunk by chunk.

    Args:
        dataset: its first axis is time, and its chunks are as wide as its rows; it has no filter but gzip.
        hand_over: does what it is given, now or later, in the same order.
    """

    def __init__(self, dataset: h5py.Dataset, hand_over: HandOver) -> None:
        self._dataset, self._hand_over = dataset, hand_over
        self._shape, self._dtype = dataset.chunks, dataset.dtype
        self._level: int | None = dataset.compression_opts
        self._start = self._filled = 0
        self._values: AnyArray = np.empty(0)

    def append(self, values: AnyArray) -> None:
        """Copy samples, (samples, ...), whatever their order in memory.

        Raises:
            FloatingPointError: a finite value is infinite in the type of the dataset.
        """
        rows = self._shape[0]
        while len(values):
            if not self._filled:
                self._values = np.empty(self._shape, self._dtype)
            taken = values[: rows - self._filled]
            with np.errstate(over="raise"):
                self._values[self._filled : self._filled + len(taken)] = taken
            self._filled += len(taken)
            values = values[len(taken) :]
            if self._filled == rows:
                self._pass_on()

    def finish(self) -> None:
        """Hand over the rest; the dataset ends with the samples there are."""
        self._hand_over(partial(self._shorten, self._start + self._filled), 0)
        if self._filled:
            self._values[self._filled :] = 0  # what no reader sees
            self._pass_on()

    def _pass_on(self) -> None:
        self._hand_over(partial(self._write, self._start, self._values), self._values.nbytes)
        self._start += self._filled
        self._filled, self._values = 0, np.empty(0)

    def _shorten(self, samples: int) -> None:
        if samples < self._dataset.shape[0]:
            self._dataset.resize(samples, axis=0)

    def _write(self, start: int, values: AnyArray) -> None:
        """Write a chunk past the library's cache."""
        content = values if self._level is None else zlib.compress(values.data, self._level)
        self._dataset.id.write_direct_chunk((start, *(0 for _ in values.shape[1:])), content)
