"""Compiled equations of motion, with tables and numbers as their data."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import POINTER, Structure, byref, c_double, c_int64, c_void_p
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.aligned_rows import address
from vsacli.compute.engine.compiler import CompilerError
from vsacli.control.simulation.equations.recording import Recording
from vsacli.control.simulation.equations.stages import Stages
from vsacli.control.simulation.table import Table

_ARGUMENTS: dict[str, list[Any]] = {
    "derivatives": [c_double, c_int64, c_void_p, c_void_p],
    "demand": [c_double, c_void_p, c_void_p],
    "to_boundaries": [c_void_p, c_void_p],
    "stages": [
        c_double,
        c_double,
        c_void_p,
        c_int64,
        c_int64,
        c_int64,
        c_void_p,
        c_void_p,
        c_void_p,
        c_void_p,
    ],
}
"""Of the functions of loop.c, behind the loop itself."""


class _Table(Structure):
    _fields_ = (
        *((name, c_int64) for name in ("cells", "powers", "columns")),
        *((name, c_void_p) for name in ("ends", "coefficients")),
    )

    @classmethod
    def of(cls, table: Table) -> _Table:
        return cls(*table.coefficients.shape, address(table.ends), address(table.coefficients))


class _Loop(Structure):
    _fields_ = (("numbers", c_void_p), ("tables", c_int64), ("table", POINTER(_Table)))

    @classmethod
    def of(cls, numbers: FloatArray, tables: Sequence[Table]) -> _Loop:
        row = _Table * len(tables)
        return cls(address(numbers), len(tables), row(*map(_Table.of, tables)))


def open_loop(path: Path) -> dict[str, Any]:
    """The functions of a compiled closed loop by name.

    Raises:
        CompilerError: they cannot be loaded.
    """
    try:
        library = ctypes.CDLL(str(path))
        functions = {name: getattr(library, name) for name in _ARGUMENTS}
    except (OSError, AttributeError) as error:
        raise CompilerError(f"what the C compiler made cannot be loaded: {error}") from None
    for name, function in functions.items():
        function.argtypes = [c_void_p, *_ARGUMENTS[name]]
        function.restype = None
    return functions


class CompiledLoop:
    """Compiled equations of motion of a closed loop.

    Args:
        functions: as `open_loop` gives them.
        numbers: of robot and controller, as the code counts them.
        recording: what was compiled.
    """

    def __init__(self, functions: dict[str, Any], numbers: FloatArray, recording: Recording) -> None:
        loops = [_Loop.of(numbers, each.tables) for each in recording]
        self._kept = (numbers, recording, loops)  # what the code has addresses of
        rates, torques, distances = map(byref, loops)
        self._derivatives = partial(functions["derivatives"], rates)
        self._stages = partial(functions["stages"], rates)
        self._demand = partial(functions["demand"], torques)
        self._to_boundaries = partial(functions["to_boundaries"], distances)
        self._motors = len(recording.torques.program.outputs)
        self._distances = np.empty(len(recording.distances.program.outputs))

    def derivatives(self, time: float, vectors: FloatArray) -> FloatArray:
        """Time derivatives of state vectors (..., entries) at a time."""
        given = np.ascontiguousarray(vectors)
        rates = np.empty_like(given)
        self._derivatives(time, given.size // given.shape[-1], address(given), address(rates))
        return rates

    def torques(self, time: float, vector: FloatArray) -> FloatArray:
        """What a controller that holds its torques asks for, (motors,), in a state."""
        given, asked = np.ascontiguousarray(vector), np.empty(self._motors)
        self._demand(time, address(given), address(asked))
        return asked

    def distance(self, vector: FloatArray) -> float:
        """To the nearest boundary, at most 1."""
        given = np.ascontiguousarray(vector)
        self._to_boundaries(address(given), address(self._distances))
        return float(self._distances.min(initial=1.0))

    def stages(
        self, time: float, step: float, vector: FloatArray, which: Stages, rates: FloatArray
    ) -> FloatArray:
        """Stages of an explicit step from a state on; returns the state at the last one.

        Args:
            time: from which on, s.
            step: its length, s.
            vector: the state there.
            which: those to compute.
            rates: at the stages, (stages, entries), of which those before are known; contiguous.
        """
        given, state = np.ascontiguousarray(vector), np.empty_like(vector)
        self._stages(
            time, step, address(given), which.first, which.last, len(which.weights), address(which.weights),
            address(which.times), address(rates), address(state),
        )  # fmt: skip
        return state
