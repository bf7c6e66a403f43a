"""The backend for single samples: kernels as functions of plain numbers, recorded after a few calls.

NumPy takes a microsecond for an operation on one number, Python 15 ns. So a controller that computes one
sample at a time does not pay for arrays of one element. It needs no compiler.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.engine.choice import NUMPY, choose_engine
from vsacli.compute.engine.engines import KEPT_PROGRAMS, Engine, Kernel, kernel_program

if TYPE_CHECKING:
    from vsacli.compute.tracing.python_functions import NumberFunction

MOST_SAMPLES = 8
"""Largest number of samples for which plain numbers are surely faster: NumPy takes the time of 30 to 60
samples for any number of them below a thousand."""

RECORDED_FROM = 16
"""Number of calls of a kernel from which it is recorded. Recording takes the time of some 25 calls: 0.03 s
for three joints, 0.1 s for seven. Who computes a single sample of many robots does not pay for it."""


class NumberEngine:
    """Plain numbers for up to `MOST_SAMPLES` samples of a kernel that is called often; else NumPy.

    Results equal those of `TracedEngine` to the last bit. Samples at which Python raises an error, where
    NumPy returns NaN or infinity, are computed by NumPy.
    """

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """See `Engine.run`."""
        samples = len(rows[0])
        function = _recorded_kernel(kernel).function_of_call() if samples <= MOST_SAMPLES else None
        if function is None:
            return NUMPY.run(kernel, rows)
        outputs = np.empty((kernel.outputs, samples))
        try:
            with np.errstate(all="ignore"):
                for sample, column in enumerate(np.asarray(rows).T.tolist()):
                    outputs[:, sample] = function(column)
        except (ArithmeticError, ValueError):
            return NUMPY.run(kernel, rows)
        return outputs


NUMBERS: Engine = NumberEngine()


def engine_of_call(engine: str | Engine, kernel: Kernel, samples: int) -> Engine:
    """Return the engine for a call from Python: plain numbers for few samples, unless another is requested.

    Args:
        engine: One of `NAMES`, or an engine, which is returned.
        kernel: Kernel to compute.
        samples: Number of samples.

    Raises:
        InputError: See `choose_engine`.
    """
    if not isinstance(engine, str):
        return engine
    if engine in ("numpy", "auto") and samples <= MOST_SAMPLES:
        return NUMBERS
    return choose_engine(engine, kernel, samples).engine


class _RecordedKernel:
    """The function of a kernel, recorded when it has been called often enough."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self._calls = 0
        self._function: NumberFunction | None = None

    def function_of_call(self) -> NumberFunction | None:
        """Count a call, and return the function; None while calls are few, or if it cannot be recorded."""
        self._calls += 1
        if self._calls == RECORDED_FROM:
            from vsacli.compute.tracing import is_of_calls
            from vsacli.compute.tracing.python_functions import number_function

            program = kernel_program(self._kernel)
            if not is_of_calls(program):
                self._function = number_function(program, exactly=True)
        return self._function


@lru_cache(maxsize=KEPT_PROGRAMS)
def _recorded_kernel(kernel: Kernel) -> _RecordedKernel:
    return _RecordedKernel(kernel)
