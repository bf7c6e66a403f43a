"""Recorded equations of motion on plain numbers of Python."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.tracing.number_function import number_function
from vsacli.control.simulation.equations.recording import Recorded


class NumberProgram:
    """A program of states and tables as a Python function: without a compiler, and before one is worth it.

    Raises:
        NotImplementedError: it has loops or branches.
    """

    def __init__(self, recorded: Recorded) -> None:
        self._function, self._tables = number_function(recorded.program), recorded.tables

    def __call__(self, time: float, vectors: FloatArray) -> FloatArray:
        """Results (..., results) for state vectors (..., entries) at a time.

        Raises:
            ArithmeticError, ValueError: where NumPy would find NaN or infinity.
        """
        columns = [number for table in self._tables for number in table(time).tolist()]
        states = vectors.reshape(-1, vectors.shape[-1]).tolist()
        results = [self._function([*state, *columns]) for state in states]
        return np.array(results).reshape(*vectors.shape[:-1], -1)
