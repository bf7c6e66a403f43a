"""The backend of compiled code: a kernel is traced, compiled unless cached, and loaded."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, partial

from vsacli.base.arrays import FloatArray
from vsacli.base.progress import Tell
from vsacli.compute.engine.compiler import Compiler, Library
from vsacli.compute.engine.engines import Kernel, kernel_program
from vsacli.compute.engine.lanes import batch_source
from vsacli.compute.engine.libraries import Code, Loaded, Worthwhile, load
from vsacli.compute.tracing import Program, Symbol
from vsacli.compute.tracing.program import NESTED

USUAL_ITERATIONS = 5
"""Usual number of iterations of a loop, for estimates of time."""


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
            opened = partial(Library, outputs=kernel.outputs)
            loaded = load(kernel_code(kernel), opened, self._compiler, self._tell, worthwhile)
            if loaded is None:
                return None
            self._loaded[kernel] = loaded
        return self._loaded[kernel]

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """See `Engine.run`."""
        self.prepare(kernel)
        return self._loaded[kernel].library(rows, self._threads)


@lru_cache(maxsize=32)
def kernel_code(kernel: Kernel) -> Code:
    """Return the C code of a kernel.

    Raises:
        NotImplementedError: The kernel cannot be traced.
    """
    program = kernel_program(kernel)
    calls = [symbol.operands[0] for symbol in program.operations if symbol.operation == "call"]
    functions = {id(call.body): call.body for call in calls} or {id(program): program}
    carried_out = {identity: operation_count(each, USUAL_ITERATIONS) for identity, each in functions.items()}
    operations = sum(carried_out[id(call.body)] for call in calls) if calls else carried_out[id(program)]
    return Code(batch_source(program), operations, tuple(map(operation_count, functions.values())))


def operation_count(program: Program, iterations: int = 1) -> int:
    """Return the number of operations of a program; those of a loop count once per iteration."""
    return sum(_weight(symbol, iterations) for symbol in program.operations)


def _weight(symbol: Symbol, iterations: int) -> int:
    if symbol.operation not in NESTED:
        return 1
    count = operation_count(symbol.operands[0].body, iterations)
    return iterations * count if symbol.operation == "loop" else count
