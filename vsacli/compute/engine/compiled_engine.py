"""The backend of compiled code: a kernel is traced, compiled unless cached, and loaded."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, partial

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.progress import Tell
from vsacli.compute.engine.compiler import Compiler, Library
from vsacli.compute.engine.costs import BRANCH_SHARE, CONDITIONAL_OPERATIONS, USUAL_ITERATIONS
from vsacli.compute.engine.engines import Kernel, NumPyEngine, kernel_program
from vsacli.compute.engine.lanes import batch_source
from vsacli.compute.engine.libraries import Code, Loaded, Worthwhile, load
from vsacli.compute.engine.trial import Trial
from vsacli.compute.tracing import Program, Symbol
from vsacli.compute.tracing.program import NESTED, conditional_count, operation_count

TRIED_SAMPLES = 19
"""Samples of a trial: whole vectors of any processor, and some left over."""


class CompiledEngine:
    """Machine code, compiled for each kernel at first use.

    Args:
        compiler: Compiler to use.
        threads: Number of threads that run at once.
        tell: Receives problems with the cache of compiled code, and announcements of long work.
    """

    def __init__(self, compiler: Compiler, threads: int, tell: Tell) -> None:
        self._compiler = compiler
        self._threads = threads
        self._tell = tell
        self._loaded: dict[Kernel, Loaded[Library]] = {}

    def prepare(self, kernel: Kernel, worthwhile: Worthwhile = lambda _code: True) -> Loaded[Library] | None:
        """Load a kernel's code; compile it if it is not cached and compiling is worthwhile, else return None.

        Raises:
            CompilerError: The code cannot be compiled.
        """
        if kernel not in self._loaded:
            open_library = partial(Library, outputs=kernel.outputs)
            make_trial = partial(_kernel_trial, kernel)
            loaded = load(
                kernel_code(kernel), open_library, self._compiler, self._tell, make_trial, worthwhile
            )
            if loaded is None:
                return None
            self._loaded[kernel] = loaded
        return self._loaded[kernel]

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """See `Engine.run`."""
        self.prepare(kernel)
        return self._loaded[kernel].library(rows, self._threads)


def _kernel_trial(kernel: Kernel) -> Trial:
    """Return a call of a kernel's code on drawn samples, of sizes that positions and stiffnesses have."""
    inputs = 10.0 ** np.random.default_rng(0).uniform(-1, 3.5, (kernel.inputs, TRIED_SAMPLES))
    with np.errstate(all="ignore"):
        expected = NumPyEngine().run(kernel, list(inputs))
    word_arguments = [row.tobytes() for row in inputs], [(row.nbytes,) for row in expected]
    return Trial("run", [0, TRIED_SAMPLES, *word_arguments], expected)


@lru_cache(maxsize=32)
def kernel_code(kernel: Kernel) -> Code:
    """Return the C code of a kernel; with other code for each run, those of a 3R take 4 times as long.

    Raises:
        NotImplementedError: The kernel cannot be traced.
    """
    program = kernel_program(kernel)
    calls = [symbol.operands[0] for symbol in program.operations if symbol.operation == "call"]
    bodies = {id(call.body): call.body for call in calls} or {id(program): program}
    operations_run = {identity: _operations_run(body) for identity, body in bodies.items()}
    operations = (
        sum(operations_run[id(call.body)] for call in calls) if calls else operations_run[id(program)]
    )
    straight = not any(map(conditional_count, bodies.values()))
    return Code(
        batch_source(program), round(operations), tuple(map(compiling_size, bodies.values())), straight
    )


def compiling_size(program: Program) -> int:
    """Return the size of a function for the compiler: operations, loops and branches as several."""
    return operation_count(program) + CONDITIONAL_OPERATIONS * conditional_count(program)


def _operations_run(program: Program) -> float:
    """Return the usual number of operations per sample, those of loops and branches as often as they run."""
    return sum(map(_runs_of_operation, program.operations))


def _runs_of_operation(symbol: Symbol) -> float:
    if symbol.operation not in NESTED:
        return 1
    repetitions = {"loop": USUAL_ITERATIONS, "branch": BRANCH_SHARE}
    return repetitions.get(symbol.operation, 1) * _operations_run(symbol.operands[0].body)
