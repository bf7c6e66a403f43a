"""From a kernel to machine code: traced, compiled unless it was before, loaded."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, partial

from vsacli.base.arrays import FloatArray
from vsacli.compute.engine.compiler import Compiler, Library
from vsacli.compute.engine.engines import Kernel, Tell, kernel_program
from vsacli.compute.engine.lanes import batch_source
from vsacli.compute.engine.libraries import Code, Loaded, Worthwhile, load
from vsacli.compute.tracing import Program, Symbol

USUAL_ITERATIONS = 5
"""How often a loop is usually repeated."""

MOST_RECORDED = 50_000
"""Operations after which recording ends; some of them, less than a tenth in chains, no output needs."""


class CompiledEngine:
    """Machine code, compiled for each kernel when it is first needed.

    Args:
        compiler: what compiles.
        threads: how many run at once.
        tell: learns what is wrong with the cache of compiled code, and what will take long.
    """

    def __init__(self, compiler: Compiler, threads: int, tell: Tell) -> None:
        self._compiler = compiler
        self._threads = threads
        self._tell = tell
        self._loaded: dict[Kernel, Loaded[Library]] = {}

    def prepare(
        self, kernel: Kernel, worthwhile: Worthwhile = lambda _operations: True
    ) -> Loaded[Library] | None:
        """Load a kernel's code, compiled if need be and if that is worthwhile; None if there is no such code.

        Raises:
            CompilerError: it cannot be compiled.
        """
        if kernel not in self._loaded:
            opened = partial(Library, outputs=kernel.outputs)
            loaded = load(_code(kernel), opened, self._compiler, self._tell, worthwhile)
            if loaded is None:
                return None
            self._loaded[kernel] = loaded
        return self._loaded[kernel]

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """As of `Engine`."""
        self.prepare(kernel)
        return self._loaded[kernel].library(rows, self._threads)


@lru_cache(maxsize=32)
def _code(kernel: Kernel) -> Code:
    """What to compile for a kernel."""
    program = kernel_program(kernel, MOST_RECORDED)
    return Code(batch_source(program), operation_count(program))


def operation_count(program: Program) -> int:
    """How many operations a program has, those of loops counted as often as they are usually repeated."""
    return sum(map(_weight, program.operations))


def _weight(symbol: Symbol) -> int:
    if symbol.operation == "loop":
        return USUAL_ITERATIONS * operation_count(symbol.operands[0].body)
    return operation_count(symbol.operands[0].body) if symbol.operation == "branch" else 1
