"""The engines: what carries out a kernel on rows of samples."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING, Protocol

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.engine.kernel import Kernel

if TYPE_CHECKING:
    from vsacli.compute.engine.compiler import Compiler
    from vsacli.compute.engine.loading import Build, Loaded, Tell

SAMPLES_PER_PASS = 12288
"""Samples that NumPy takes at a time: fewer waste time in the interpreter, more leave the caches."""

INPUTS_PER_PASS = 5 * 2**19
"""Bound on a kernel's inputs times samples at a time: the recursion keeps about 100 bytes for each."""

KEPT_MEMORY = 31 * 2**20
"""Bytes: glibc then keeps twice that, more than a pass takes in arrays; from 32 MiB on it learns nothing."""


def samples_per_pass(inputs: int) -> int:
    """Samples that NumPy takes at a time of a kernel with so many inputs."""
    return max(1, min(SAMPLES_PER_PASS, INPUTS_PER_PASS // inputs))


def passes(rows: Sequence[FloatArray]) -> Iterator[slice]:
    """The samples of each pass over a kernel's inputs."""
    samples = samples_per_pass(len(rows))
    for start in range(0, len(rows[0]), samples):
        yield slice(start, start + samples)


class Engine(Protocol):
    """What carries out kernels."""

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """The kernel's outputs, (outputs, samples), from its inputs, contiguous rows (samples,)."""


class NumPyEngine:
    """The kernel itself, on a number of samples at a time."""

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """As of `Engine`."""
        keep_freed_memory()
        outputs = np.empty((kernel.outputs, len(rows[0])))
        for part in passes(rows):
            for output, row in zip(outputs, kernel([row[part] for row in rows]), strict=True):
                output[part] = row
        return outputs


@cache
def keep_freed_memory() -> None:
    """Have the C library use the memory again that arrays have left.

    That of glibc gives blocks back to the system from a size on that it adjusts to the largest block freed so
    far, mallopt(3), and the system clears them page by page when they are asked for again. The one freed here
    is never touched, so it takes no memory itself. Other libraries do as they like.
    """
    np.empty(KEPT_MEMORY, dtype=np.uint8)


class CompiledEngine:
    """Machine code, compiled for each kernel when it is first needed.

    Args:
        compiler: what compiles.
        threads: how many run at once.
        tell: learns what is wrong with the cache of compiled code.
    """

    def __init__(self, compiler: Compiler, threads: int, tell: Tell) -> None:
        self._compiler = compiler
        self._threads = threads
        self._tell = tell
        self._loaded: dict[Kernel, Loaded] = {}

    def prepare(self, kernel: Kernel, build: Build = lambda _operations: True) -> Loaded | None:
        """Load a kernel's code, compiled if need be and if `build` wants it; None if there is no such code.

        Raises:
            CompilerError: it cannot be compiled.
        """
        if kernel not in self._loaded:
            from vsacli.compute.engine.loading import load

            loaded = load(kernel, self._compiler, self._tell, build)
            if loaded is None:
                return None
            self._loaded[kernel] = loaded
        return self._loaded[kernel]

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """As of `Engine`."""
        self.prepare(kernel)
        return self._loaded[kernel].library(rows, self._threads)
