"""Kernels, which compute on rows of samples, and the NumPy backends that run them."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.engine.costs import CONDITIONAL_OPERATIONS, MOST_UNROLLED
from vsacli.compute.subnormals import subnormals_as_zero

if TYPE_CHECKING:
    from vsacli.compute.tracing import Program
    from vsacli.compute.tracing.row_functions import CallingRowFunction, RowFunction

SAMPLES_PER_PASS = 12288
"""Samples per pass of NumPy: fewer waste time in the interpreter, more leave the caches."""

INPUTS_PER_PASS = 9 * 2**17
"""Bound on a kernel's inputs times samples per pass: for each, the recursion keeps about 60 bytes, and two
blocks about 40 bytes each. So a run of any chain stays below 300 MB; with twice the bound it took 420 MB."""

KEPT_MEMORY = 31 * 2**20
"""Size of the block freed once, in bytes: glibc then keeps twice that, more than the arrays of a pass need;
it does not adjust to blocks from 32 MiB on."""

KEPT_PROGRAMS = 8
"""Number of kernels whose programs are kept for the next call: with a program for each run, 10^5 samples of a
3R take 4.9 times as long."""


class Kernel(Hashable, Protocol):
    """A function of rows of samples, run by NumPy or traced; equal kernels compute the same."""

    @property
    def inputs(self) -> int:
        """Number of input rows."""

    @property
    def outputs(self) -> int:
        """Number of output rows."""

    def __call__(self, rows: Sequence[Any]) -> Sequence[Any]:
        """Return rows of results, (samples,), or constants in their place.

        Every sample is computed independently, without a conditional on values.
        """


def samples_per_pass(inputs: int) -> int:
    """Return the number of samples per pass of NumPy, for a kernel with this many inputs."""
    return max(1, min(SAMPLES_PER_PASS, INPUTS_PER_PASS // inputs))


def passes(rows: Sequence[FloatArray]) -> Iterator[slice]:
    """Yield the samples of each pass over a kernel's inputs."""
    samples = samples_per_pass(len(rows))
    for start in range(0, len(rows[0]), samples):
        yield slice(start, start + samples)


class Engine(Protocol):
    """A backend that runs kernels."""

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """Return the kernel's outputs, (outputs, samples), from its inputs, contiguous rows (samples,)."""


class NumPyEngine:
    """NumPy on the kernel itself, pass by pass."""

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """See `Engine.run`."""
        keep_freed_memory()
        outputs = np.empty((kernel.outputs, len(rows[0])))
        with subnormals_as_zero():
            for pass_slice in passes(rows):
                for output, result in zip(
                    outputs, kernel([result[pass_slice] for result in rows]), strict=True
                ):
                    output[pass_slice] = result
        return outputs


@cache
def keep_freed_memory() -> None:
    """Make the C library reuse the memory of freed arrays.

    glibc returns blocks above a threshold to the system, which clears them page by page when they are
    allocated again. It raises the threshold to the largest block freed so far, mallopt(3), so a large block
    is freed here; it is never touched and needs no memory. Other C libraries are not affected.
    """
    np.empty(KEPT_MEMORY, dtype=np.uint8)


class TracedEngine:
    """NumPy on the program of each kernel, traced at first use; a kernel with loops runs untraced.

    Tracing pays off for many samples. Results equal those of `NumPyEngine` to the last bit, except for
    powers: exponents 3, 4 and 1.5 are traced as products. Untraced, 10^5 samples of a 7R take 1.8 times as
    long.
    """

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """See `Engine.run`."""
        function = _row_function(kernel)
        if function is None:
            return NumPyEngine().run(kernel, rows)
        workspace = function.workspace(samples_per_pass(len(rows)))
        outputs = np.empty((kernel.outputs, len(rows[0])))
        with subnormals_as_zero():
            for part in passes(rows):
                function([row[part] for row in rows], outputs[:, part], workspace)
        return outputs


@lru_cache(maxsize=KEPT_PROGRAMS)
def _row_function(kernel: Kernel) -> RowFunction | CallingRowFunction | None:
    """Return the program of a kernel on rows of samples; None if it has loops or tables."""
    from vsacli.compute.tracing import is_of_calls
    from vsacli.compute.tracing.row_functions import CallingRowFunction, RowFunction

    try:
        program = kernel_program(kernel)
        return CallingRowFunction(program) if is_of_calls(program) else RowFunction(program)
    except NotImplementedError:
        return None


def kernel_program(kernel: Kernel) -> Program:
    """Return the program of a kernel for one sample, with calls if it is long.

    Raises:
        NotImplementedError: See `trace`.
    """
    from vsacli.compute.tracing import Kind, trace_by_size

    kinds = [Kind.REAL] * kernel.inputs
    return trace_by_size(kernel, kinds, MOST_UNROLLED, conditional=CONDITIONAL_OPERATIONS)
