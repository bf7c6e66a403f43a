"""The equations of motion of a closed loop, evaluated by the fastest backend for the length of a run.

`LoopEquations` evaluates them with NumPy, for any controller. `RecordedEquations` changes from NumPy to a
program on plain numbers, and from that to compiled code, once a run is long enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.progress import Tell, unheard
from vsacli.compute.engine.choice import check_engine, compiled_as_asked
from vsacli.compute.engine.compiler import CompilerError, system_compiler
from vsacli.compute.engine.libraries import Code, Worthwhile, load
from vsacli.compute.tracing.python_functions import number_function
from vsacli.control.simulation.boundaries import Boundary
from vsacli.control.simulation.closed_loop import ClosedLoop
from vsacli.control.simulation.compiled_loop import CompiledLoop, Stages, loop_trial, open_loop
from vsacli.control.simulation.ending import Budget, Ending
from vsacli.control.simulation.loop_code import LoopPrograms, StateProgram, loop_code, record_loop


class LoopEquations:
    """The equations of motion of a closed loop evaluated with NumPy, with the boundaries of a run.

    Args:
        loop: robot under its controller.
        boundaries: boundaries at which a run ends.
        budget: budget of evaluations.
    """

    def __init__(self, loop: ClosedLoop, boundaries: Sequence[Boundary], budget: Budget) -> None:
        self.loop, self.boundaries, self.budget = loop, tuple(boundaries), budget

    @property
    def provenance(self) -> dict[str, str]:
        """Backend of the computation: `engine`, `compiler`, `threads`."""
        return {"engine": "numpy", "compiler": "", "threads": "1"}

    def __call__(self, time: float, vectors: FloatArray) -> FloatArray:
        """Return the time derivatives of state vectors, (..., entries), at a time, s.

        Raises:
            SpentError: the budget does not allow it.
        """
        self.budget.check(evaluations := vectors.size // vectors.shape[-1])
        self.budget.used += evaluations
        return self.loop.derivative(time, vectors)

    def torques(self, time: float, vector: FloatArray) -> FloatArray:
        """Return the held torques that a controller commands in a state, (motors,)."""
        return self.loop.controller_torque(time, vector)

    def stages(
        self, _time: float, _step: float, _vector: FloatArray, _which: Stages, _rates: FloatArray
    ) -> FloatArray | None:
        """Compute stages of an explicit step; see `CompiledLoop.stages`. None leaves them to SciPy.

        Raises:
            SpentError: the budget does not allow it.
        """
        return None

    def distance(self, vector: FloatArray) -> float:
        """Return the distance of a state from the nearest boundary, at most 1."""
        return min((float(boundary.distance(vector)) for boundary in self.boundaries), default=1.0)


class Edge:
    """The event at the first boundary that is reached.

    Args:
        equations: equations of motion, with their boundaries.
    """

    def __init__(self, equations: LoopEquations) -> None:
        self._equations = equations

    def __call__(self, _time: float, vector: FloatArray) -> float:
        """Return the distance to the nearest boundary."""
        return self._equations.distance(vector)

    def ending(self, time: float, vector: FloatArray) -> Ending:
        """Return the end of a run at this time and state."""
        reached = min(self._equations.boundaries, key=lambda boundary: float(boundary.distance(vector)))
        return reached.ending(time, vector)


class NumberProgram:
    """A program of states and tables as a Python function, used without compiled code or before it pays off.

    Evaluated by NumPy, a simulation of the 3R without a compiler takes 4.3 times as long.

    Raises:
        NotImplementedError: the program has loops or conditionals.
    """

    def __init__(self, recording: StateProgram) -> None:
        self._function, self._tables = number_function(recording.program), recording.tables

    def __call__(self, time: float, vectors: FloatArray) -> FloatArray:
        """Return results, (..., results), for state vectors, (..., entries), at a time.

        Raises:
            ArithmeticError, ValueError: NumPy would return NaN or infinity.
        """
        columns = [column for table in self._tables for column in table(time).tolist()]
        states = vectors.reshape(-1, vectors.shape[-1]).tolist()
        results = [self._function([*state, *columns]) for state in states]
        return np.array(results).reshape(*vectors.shape[:-1], -1)


RECORD_FROM = 50
"""Evaluations per joint beyond which a program saves more time than recording it takes: 3 to 30 ms with three
joints, 30 to 130 ms with seven, while an evaluation with NumPy takes 0.1 to 0.3 ms."""

NUMBER_SECONDS = 4e-8
"""Time of a Python operation on plain numbers, s."""

NUMPY_SECONDS = 2e-4
"""Time of an evaluation with NumPy, s."""

CACHE_SECONDS = 0.02
"""Time to look for compiled code in the cache, s."""


class Computing(NamedTuple):
    """The backend of the equations of motion.

    Attributes:
        engine: "numpy" to compile nothing, "c" to compile at once, "auto" to compile when that saves time.
        tell: function called with problems of compiled code, and announcements of long work.
        runs: number of runs that share the compiled code.
    """

    engine: str
    tell: Tell = unheard
    runs: int = 1


class RecordedEquations(LoopEquations):
    """Equations that change from NumPy to a program on plain numbers, and from that to compiled code.

    A backend is made when the earlier ones have taken about as long as making it takes. So a run never takes
    much more than twice the time of the best choice, however long it becomes. The change depends on the
    number of evaluations, not on measured time, so that a run is repeatable to the last bit unless the cache
    has new code.

    Args:
        loop: robot under its controller.
        boundaries: boundaries at which a run ends.
        budget: budget of evaluations.
        computing: choice of the backend.

    Raises:
        InputError: the engine is unknown; or, at the first evaluation, it is "c" and there is no working
            compiler, or the loop cannot be compiled.
    """

    def __init__(
        self, loop: ClosedLoop, boundaries: Sequence[Boundary], budget: Budget, computing: Computing
    ) -> None:
        super().__init__(loop, boundaries, budget)
        check_engine(computing.engine)
        self._computing = computing
        self._rate_program: NumberProgram | None = None
        self._torque_program: NumberProgram | None = None
        self._compiled_loop: CompiledLoop | None = None
        self._compiler = ""
        self._last_state = 0.0, np.zeros(0)
        self._backends = self._compiled_backend() if computing.engine == "c" else self._faster_backends()
        self._next_change = next(self._backends)

    @property
    def provenance(self) -> dict[str, str]:
        """See `Equations.provenance`; that of the last evaluation."""
        if self._compiled_loop is None:
            return super().provenance
        return {"engine": "c", "compiler": self._compiler, "threads": "1"}

    def __call__(self, time: float, vectors: FloatArray) -> FloatArray:
        """See `Equations.__call__`; NumPy evaluates again where a result is not finite."""
        self._change_backend(time, vectors)
        self.budget.check(evaluations := vectors.size // vectors.shape[-1])
        rates = _finite_values(
            self._compiled_loop.derivatives if self._compiled_loop else self._rate_program, time, vectors
        )
        if rates is None:
            return super().__call__(time, vectors)
        self.budget.used += evaluations
        return rates

    def torques(self, time: float, vector: FloatArray) -> FloatArray:
        """See `Equations.torques`; by NumPy, feedback of the positions of the 3R takes 2.3 times as long."""
        asked = _finite_values(
            self._compiled_loop.torques if self._compiled_loop else self._torque_program, time, vector
        )
        return super().torques(time, vector) if asked is None else asked

    def stages(
        self, time: float, step: float, vector: FloatArray, which: Stages, rates: FloatArray
    ) -> FloatArray | None:
        """See `Equations.stages`; one by one, a simulation of the 3R takes 1.23 times as long."""
        self._change_backend(time, vector)
        if self._compiled_loop is None:
            return None
        self.budget.check(evaluations := which.last - which.first + 1)
        state = self._compiled_loop.stages(time, step, vector, which, rates)
        if state is not None:
            self.budget.used += evaluations
        return state

    def distance(self, vector: FloatArray) -> float:
        """See `Equations.distance`; by NumPy, a simulation of the 3R takes 1.2 times as long."""
        return (
            super().distance(vector) if self._compiled_loop is None else self._compiled_loop.distance(vector)
        )

    def _change_backend(self, time: float, vectors: FloatArray) -> None:
        """Change to the next backend if it is due; compiled code is tried near these states."""
        if self.budget.used >= self._next_change:
            self._last_state = time, vectors
            self._next_change = next(self._backends, math.inf)

    def _faster_backends(self) -> Iterator[float]:
        """Make one faster backend after the other; yield the number of evaluations at which to continue.

        One of several runs looks for the code of an earlier one at once, which saves 40 % of its time.
        """
        shared = self._computing.runs > 1 and self._computing.engine == "auto"
        yield 0.0 if shared else RECORD_FROM * len(self.loop.plant.drivetrain.present)
        with suppress(NotImplementedError, CompilerError):
            recording = record_loop(self.loop, self.boundaries)
            if shared:
                self._load_compiled(recording, *loop_code(recording), lambda _code: False)
            if self._compiled_loop is None:
                yield from self._recorded_backends(recording, cache_checked=shared)

    def _recorded_backends(self, recording: LoopPrograms, *, cache_checked: bool) -> Iterator[float]:
        """Use a program on plain numbers, then compiled code; yield like `_faster_backends`.

        With `cache_checked`, compiled code is not in the cache.
        """
        with suppress(NotImplementedError):  # raised for programs with loops
            self._rate_program = NumberProgram(recording.rates)
            self._torque_program = NumberProgram(recording.torques)
        evaluations, evaluation_seconds = (
            self.budget.used,
            self._evaluation_seconds(recording) * self._computing.runs,
        )
        if self._computing.engine == "auto":
            if not cache_checked:
                yield evaluations + CACHE_SECONDS / evaluation_seconds
            code, numbers = loop_code(recording)
            if not cache_checked:
                self._load_compiled(recording, code, numbers, lambda _code: False)
            if self._compiled_loop is None:
                yield evaluations + code.compiling_seconds / evaluation_seconds
                self._load_compiled(recording, code, numbers, lambda _code: True)

    def _evaluation_seconds(self, recording: LoopPrograms) -> float:
        """Return the time of an evaluation without compiled code, s."""
        operations = len(recording.rates.program.operations)
        return NUMPY_SECONDS if self._rate_program is None else NUMBER_SECONDS * operations

    def _compiled_backend(self) -> Iterator[float]:
        """Compile at once, for the engine "c"; yield as `_faster_backends`. Failure is an InputError."""
        yield 0.0
        with compiled_as_asked():
            recording = record_loop(self.loop, self.boundaries)
            self._load_compiled(recording, *loop_code(recording), lambda _code: True)

    def _load_compiled(
        self, recording: LoopPrograms, code: Code, numbers: FloatArray, worthwhile: Worthwhile
    ) -> None:
        """Load compiled code; compile it if `worthwhile`.

        Raises:
            CompilerError: the code cannot be compiled or loaded.
        """
        compiler = system_compiler()
        make_trial = partial(loop_trial, self.loop, *self._last_state, numbers, recording)
        loaded = load(code, open_loop, compiler, self._computing.tell, make_trial, worthwhile)
        if loaded is not None:
            self._compiled_loop, self._compiler = (
                CompiledLoop(loaded.library, numbers, recording),
                compiler.name,
            )


def _finite_values(
    function: Callable[[float, FloatArray], FloatArray] | None, time: float, vectors: FloatArray
) -> FloatArray | None:
    """Return the values of a function at states; None without a function, or if a value is not finite."""
    if function is not None:
        with suppress(ArithmeticError, ValueError):  # Python raises these where NumPy returns NaN or infinity
            values = function(time, vectors)
            if math.isfinite(values.sum()):
                return values
    return None
