"""From a kernel to machine code: traced, compiled unless it was before, loaded."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import StorageError
from vsacli.base.storage import reporting_temporary_errors, temporary_folder
from vsacli.compute.engine.cache import LIBRARY, Cache, CacheError, key_of, open_cache
from vsacli.compute.engine.compiler import TIMEOUT, Compiler, CompilerError, Library
from vsacli.compute.engine.engines import Kernel, Tell, kernel_program
from vsacli.compute.engine.lanes import batch_source
from vsacli.compute.tracing import Program, Symbol

Worthwhile = Callable[[int], bool]
"""Whether code of so many operations shall be compiled."""

USUAL_ITERATIONS = 5
"""How often a loop is usually repeated."""


COMPILER_START_SECONDS = 0.25
COMPILER_SECONDS_PER_SQUARE = 2.5e-8
"""What the compiler takes to start, and for the square of the number of operations."""

LONG_SECONDS = 5.0
"""From which on the user is told before."""

MOST_OPERATIONS = 40_000
"""Of a program that is compiled, those of 50 joints with cubic springs: gcc takes 40 s for it and 0.6 GB."""

MOST_RECORDED = 50_000
"""Operations after which recording ends; some of them, less than a tenth in chains, no output needs."""


class Loaded(NamedTuple):
    """A library, and whether it had to be compiled for this process."""

    library: Library
    compiled: bool


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
        self._loaded: dict[Kernel, Loaded] = {}

    def prepare(self, kernel: Kernel, worthwhile: Worthwhile = lambda _operations: True) -> Loaded | None:
        """Load a kernel's code, compiled if need be and if that is worthwhile; None if there is no such code.

        Raises:
            CompilerError: it cannot be compiled.
        """
        if kernel not in self._loaded:
            loaded = _load(kernel, self._compiler, self._tell, worthwhile)
            if loaded is None:
                return None
            self._loaded[kernel] = loaded
        return self._loaded[kernel]

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """As of `Engine`."""
        self.prepare(kernel)
        return self._loaded[kernel].library(rows, self._threads)


def _load(kernel: Kernel, compiler: Compiler, tell: Tell, worthwhile: Worthwhile) -> Loaded | None:
    """The library of a kernel; None if it is not there and not worth compiling.

    Args:
        kernel: what it computes.
        compiler: what compiles it.
        tell: learns what is wrong with the cache, which is no reason to fail, and what will take long.
        worthwhile: whether to compile so many operations if they are not in the cache.

    Raises:
        CompilerError: it cannot be compiled or loaded.
    """
    source, count = _source(kernel)
    key = key_of(source, compiler.identity)
    if key not in _loaded:
        cache = _opened(tell)
        kept = None if cache is None else _found(cache, key, kernel.outputs, tell)
        if kept is not None:
            _loaded[key] = Loaded(kept, compiled=False)
        elif worthwhile(count):
            _announce(count, tell)
            _loaded[key] = Loaded(_built(source, key, kernel.outputs, compiler, cache, tell), compiled=True)
    return _loaded.get(key)


def compiling_seconds(operations: int) -> float:
    """What the compiler takes, about."""
    return COMPILER_START_SECONDS + COMPILER_SECONDS_PER_SQUARE * operations**2


def _announce(operations: int, tell: Tell) -> None:
    """Say that it takes long, if it does.

    Raises:
        CompilerError: it takes too long.
    """
    if operations > MOST_OPERATIONS:
        raise CompilerError(
            f"a step takes {operations} operations, more than the {MOST_OPERATIONS} that are compiled"
        )
    seconds = compiling_seconds(operations)
    if seconds > LONG_SECONDS:
        tell(f"compiling takes about {seconds:.0f} s, this once (at most {TIMEOUT:g} s)")


_loaded: dict[str, Loaded] = {}
"""What this process has loaded, by its key."""


@lru_cache(maxsize=32)
def _source(kernel: Kernel) -> tuple[str, int]:
    """The code of a kernel, and how many operations it has."""
    program = kernel_program(kernel, MOST_RECORDED)
    return batch_source(program), operation_count(program)


def operation_count(program: Program) -> int:
    """How many operations a program has, those of loops counted as often as they are usually repeated."""
    return sum(map(_weight, program.operations))


def _weight(symbol: Symbol) -> int:
    if symbol.operation == "loop":
        return USUAL_ITERATIONS * operation_count(symbol.operands[0].body)
    return operation_count(symbol.operands[0].body) if symbol.operation == "branch" else 1


def _opened(tell: Tell) -> Cache | None:
    try:
        return open_cache()
    except CacheError as error:
        tell(f"{error}; compiled code is not kept")
        return None


def _found(cache: Cache, key: str, outputs: int, tell: Tell) -> Library | None:
    try:
        path = cache.find(key)
        return None if path is None else Library(path, outputs)
    except CacheError as error:
        tell(str(error))
    except CompilerError as error:  # as in a folder from which nothing may be run
        tell(f"{error}; it is compiled anew")
    return None


def _built(
    source: str, key: str, outputs: int, compiler: Compiler, cache: Cache | None, tell: Tell
) -> Library:
    try:
        with temporary_folder() as folder:
            text, library = folder / "program.c", folder / LIBRARY
            with reporting_temporary_errors():
                text.write_text(source, encoding="utf-8")
            compiler.build(text, library)
            loaded = Library(library, outputs)
            if cache is not None:
                _keep(cache, key, library, tell)
            return loaded
    except StorageError as error:
        raise CompilerError(str(error)) from None


def _keep(cache: Cache, key: str, library: Path, tell: Tell) -> None:
    try:
        cache.store(key, library)
    except CacheError as error:
        tell(f"{error}; compiled code is not kept")
