"""Compiled equations of motion, and a DOP853 of SciPy whose stages they compute in one call."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import POINTER, Structure, byref, c_double, c_int64, c_void_p
from functools import cache, partial
from pathlib import Path
from types import FunctionType, MethodType
from typing import Any, NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray
from vsacli.compute.engine.compiler import CompilerError
from vsacli.compute.engine.trial import Trial
from vsacli.control.simulation.closed_loop import ClosedLoop
from vsacli.control.simulation.loop_code import LoopPrograms
from vsacli.control.simulation.tabulated import Table

LARGEST_GROWTH = 1.1
"""Largest ratio of a step to the one before, unless steps grow faster already, as they do at the start.

Where the error estimate passes through zero, SciPy lengthens a step up to ten times and accepts it,
whatever its error. Rounding decides which steps these are: with three backends and the kernels of five
processors, the largest position error of three runs of the paper's robot was 2e-11 to 4e-9 rad without this
bound, and 5e-11 to 1.4e-10 rad with it, after 1 to 7 % fewer evaluations, since fewer steps are rejected.
"""


class Stages(NamedTuple):
    """Stages of an explicit Runge-Kutta method.

    Attributes:
        first, last: indices of the first and last stage to compute.
        weights: weights of the rates at the stages before each stage, (stages, stages).
        times: times of the stages as shares of the step, (stages,).
    """

    first: int
    last: int
    weights: FloatArray
    times: FloatArray


@cache
def dop853_with_stages() -> Any:
    """Return a class with the step and error control of SciPy's DOP853 that computes stages in one call.

    Its constructor has a further argument, `stages`, a function like `Equations.stages`. If this returns
    None, SciPy evaluates one stage after the other. Steps grow as `LARGEST_GROWTH` allows. SciPy has no
    hooks for that, so the code of its `_step_impl` is run with another `rk_step` and `MAX_FACTOR` among its
    globals.
    """
    dop853: Any = scipy.integrate.DOP853  # its type stubs lack the members that a derived method needs
    weights, times = _all_weights_and_times(dop853)
    stage_count = dop853.n_stages
    step_stages, dense_stages = (
        Stages(1, stage_count, weights, times),
        Stages(stage_count + 1, len(times) - 1, weights, times),
    )
    scipy_step = dop853._step_impl
    scipy_rk_step = scipy_step.__globals__.get("rk_step")

    class WithStages(dop853):  # type: ignore[misc]
        def __init__(self, *arguments: Any, stages: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            self._stages = stages
            self._names = {**scipy_step.__globals__, "rk_step": self._rk_step}
            self._scipy_step = MethodType(FunctionType(scipy_step.__code__, self._names), self)

        def _step_impl(self) -> Any:
            start_time = self.t
            outcome = self._scipy_step()
            if length := abs(self.t - start_time):
                self._names["MAX_FACTOR"] = max(LARGEST_GROWTH, self.h_abs / length)
            return outcome

        def _rk_step(self, fun: Any, t: Any, y: Any, f: Any, h: Any, *tableau: Any) -> Any:
            """Return the state at the end of a trial step, and its rates; store those of the stages in K."""
            self.K[0] = f
            state = self._stages(t, h, y, step_stages, self.K_extended)
            return scipy_rk_step(fun, t, y, f, h, *tableau) if state is None else (state, self.K[-1].copy())

        def _dense_output_impl(self) -> Any:
            last_state = self._stages(self.t_old, self.h_previous, self.y_old, dense_stages, self.K_extended)
            self.A_EXTRA = (
                dop853.A_EXTRA if last_state is None else dop853.A_EXTRA[:0]
            )  # stages left to SciPy
            return super()._dense_output_impl()

    return WithStages


def _all_weights_and_times(method: Any) -> tuple[FloatArray, FloatArray]:
    """Return weights and times of all stages: of the step, of its end, and of dense output."""
    stage_count = method.n_stages
    weights = np.zeros((stage_count + 1 + len(method.A_EXTRA),) * 2)
    weights[:stage_count, :stage_count], weights[stage_count, :stage_count], weights[stage_count + 1 :] = (
        method.A,
        method.B,
        method.A_EXTRA,
    )
    return weights, np.array([*method.C, 1.0, *method.C_EXTRA])


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
"""Types of the arguments of the functions in loop.c, after the first one, the loop."""


class _CTable(Structure):
    _fields_ = (
        *((name, c_int64) for name in ("cells", "powers", "columns")),
        *((name, c_void_p) for name in ("ends", "coefficients")),
    )

    @classmethod
    def of(cls, table: Table) -> _CTable:
        return cls(*table.coefficients.shape, table.ends.ctypes.data, table.coefficients.ctypes.data)


class _CLoop(Structure):
    _fields_ = (("numbers", c_void_p), ("tables", c_int64), ("table", POINTER(_CTable)))

    @classmethod
    def of(cls, numbers: FloatArray, tables: Sequence[Table]) -> _CLoop:
        array_type = _CTable * len(tables)
        return cls(numbers.ctypes.data, len(tables), array_type(*map(_CTable.of, tables)))


def open_loop(path: Path) -> dict[str, Any]:
    """Load the functions of a compiled closed loop, by name.

    Raises:
        CompilerError: the functions cannot be loaded.
    """
    try:
        library = ctypes.CDLL(str(path))
        functions = {name: getattr(library, name) for name in _ARGUMENTS}
    except (OSError, AttributeError) as error:
        raise CompilerError(f"what the C compiler made cannot be loaded: {error}") from None
    for name, function in functions.items():
        function.argtypes = [c_void_p, *_ARGUMENTS[name]]
        function.restype = c_int64 if name == "stages" else None
    return functions


def loop_trial(
    loop: ClosedLoop, time: float, vectors: FloatArray, numbers: FloatArray, recording: LoopPrograms
) -> Trial:
    """Return a call of the compiled equations of motion at states about some, (..., entries).

    In equilibrium rates are differences of large torques; those of drawn states nearby give their scale.
    """
    tables = [
        argument
        for table in recording.rates.tables
        for argument in (*table.coefficients.shape, table.ends.tobytes(), table.coefficients.tobytes())
    ]
    perturbation = np.random.default_rng(0).uniform(-1e-3, 1e-3, (8, recording.entries))
    states = vectors.reshape(-1, recording.entries)[0] * (1 + perturbation[::-1]) + perturbation
    expected = np.ascontiguousarray(loop.derivative(time, states))
    arguments = [
        [numbers.tobytes(), len(recording.rates.tables), tables],
        float(time),
        len(states),
        states.tobytes(),
        (expected.nbytes,),
    ]
    return Trial("derivatives", arguments, expected.T)


class CompiledLoop:
    """Compiled equations of motion of a closed loop.

    Args:
        functions: functions by name, from `open_loop`.
        numbers: constants of robot and controller, in the order of `loop_code`.
        recording: recorded loop that was compiled.
    """

    def __init__(self, functions: dict[str, Any], numbers: FloatArray, recording: LoopPrograms) -> None:
        loops = [_CLoop.of(numbers, state_program.tables) for state_program in recording]
        self._alive = (numbers, recording, loops)  # keeps alive the arrays to which the code has pointers
        rates, torques, distances = map(byref, loops)
        self._derivatives = partial(functions["derivatives"], rates)
        self._stages = partial(functions["stages"], rates)
        self._demand = partial(functions["demand"], torques)
        self._to_boundaries = partial(functions["to_boundaries"], distances)
        self._motors = len(recording.torques.program.outputs)
        self._distances = np.empty(len(recording.distances.program.outputs))

    def derivatives(self, time: float, vectors: FloatArray) -> FloatArray:
        """Return the time derivatives of state vectors, (..., entries), at a time."""
        contiguous = np.ascontiguousarray(vectors)
        rates = np.empty_like(contiguous)
        self._derivatives(
            time, contiguous.size // contiguous.shape[-1], contiguous.ctypes.data, rates.ctypes.data
        )
        return rates

    def torques(self, time: float, vector: FloatArray) -> FloatArray:
        """Return the torques, (motors,), that a controller which holds them commands in a state."""
        contiguous, commanded = np.ascontiguousarray(vector), np.empty(self._motors)
        self._demand(time, contiguous.ctypes.data, commanded.ctypes.data)
        return commanded

    def distance(self, vector: FloatArray) -> float:
        """Return the distance to the nearest boundary, at most 1."""
        contiguous = np.ascontiguousarray(vector)
        self._to_boundaries(contiguous.ctypes.data, self._distances.ctypes.data)
        return float(self._distances.min(initial=1.0))  # there may be none

    def stages(
        self, time: float, step: float, vector: FloatArray, which: Stages, rates: FloatArray
    ) -> FloatArray | None:
        """Compute stages of an explicit step; return the state at the last one, None if rates are not finite.

        Args:
            time: time at the start of the step, s.
            step: length of the step, s.
            vector: state at its start.
            which: stages to compute.
            rates: rates at the stages, (stages, entries), contiguous; those of earlier stages are read, the
                computed ones are written.
        """
        start_state, state = np.ascontiguousarray(vector), np.empty_like(vector)
        finite = self._stages(
            time, step, start_state.ctypes.data, which.first, which.last, len(which.weights),
            which.weights.ctypes.data, which.times.ctypes.data, rates.ctypes.data, state.ctypes.data,
        )  # fmt: skip
        return state if finite else None
