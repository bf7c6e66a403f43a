"""From a kernel to machine code: traced, compiled unless it was before, loaded."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from vsacli.base.arrays import FloatArray
from vsacli.compute.engine.cache import LIBRARY, Cache, CacheError, key_of, open_cache
from vsacli.compute.engine.compiler import Compiler, Library
from vsacli.compute.engine.engines import Kernel, kernel_program
from vsacli.compute.engine.lanes import batch_source
from vsacli.compute.tracing import Program, Symbol

Warn = Callable[[str], None]
"""Receives a warning for the user."""

Worthwhile = Callable[[int], bool]
"""Whether code of so many operations shall be compiled."""

USUAL_ITERATIONS = 5
"""How often a loop is usually repeated."""


class Loaded(NamedTuple):
    """A library, and whether it had to be compiled for this process."""

    library: Library
    compiled: bool


class CompiledEngine:
    """Machine code, compiled for each kernel when it is first needed.

    Args:
        compiler: what compiles.
        threads: how many run at once.
        warn: learns what is wrong with the cache of compiled code.
    """

    def __init__(self, compiler: Compiler, threads: int, warn: Warn) -> None:
        self._compiler = compiler
        self._threads = threads
        self._warn = warn
        self._loaded: dict[Kernel, Loaded] = {}

    def prepare(self, kernel: Kernel, worthwhile: Worthwhile = lambda _operations: True) -> Loaded | None:
        """Load a kernel's code, compiled if need be and if that is worthwhile; None if there is no such code.

        Raises:
            CompilerError: it cannot be compiled.
        """
        if kernel not in self._loaded:
            loaded = _load(kernel, self._compiler, self._warn, worthwhile)
            if loaded is None:
                return None
            self._loaded[kernel] = loaded
        return self._loaded[kernel]

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """As of `Engine`."""
        self.prepare(kernel)
        return self._loaded[kernel].library(rows, self._threads)


def _load(kernel: Kernel, compiler: Compiler, warn: Warn, worthwhile: Worthwhile) -> Loaded | None:
    """The library of a kernel; None if it is not there and not worth compiling.

    Args:
        kernel: what it computes.
        compiler: what compiles it.
        warn: learns what is wrong with the cache, which is no reason to fail.
        worthwhile: whether to compile so many operations if they are not in the cache.

    Raises:
        CompilerError: it cannot be compiled or loaded.
    """
    source, count = _source(kernel)
    key = key_of(source, compiler.identity)
    if key not in _loaded:
        cache = _opened(warn)
        path = None if cache is None else _found(cache, key, warn)
        if path is not None:
            _loaded[key] = Loaded(Library(path, kernel.outputs), compiled=False)
        elif worthwhile(count):
            _loaded[key] = Loaded(_built(source, key, kernel.outputs, compiler, cache, warn), compiled=True)
    return _loaded.get(key)


_loaded: dict[str, Loaded] = {}
"""What this process has loaded, by its key."""


@lru_cache(maxsize=32)
def _source(kernel: Kernel) -> tuple[str, int]:
    """The code of a kernel, and how many operations it has."""
    program = kernel_program(kernel)
    return batch_source(program), operation_count(program)


def operation_count(program: Program) -> int:
    """How many operations a program has, those of loops counted as often as they are usually repeated."""
    return sum(map(_weight, program.operations))


def _weight(symbol: Symbol) -> int:
    if symbol.operation == "loop":
        return USUAL_ITERATIONS * operation_count(symbol.operands[0].body)
    return operation_count(symbol.operands[0].body) if symbol.operation == "branch" else 1


def _opened(warn: Warn) -> Cache | None:
    try:
        return open_cache()
    except CacheError as error:
        warn(f"{error}; compiled code is not kept")
        return None


def _found(cache: Cache, key: str, warn: Warn) -> Path | None:
    try:
        return cache.find(key)
    except CacheError as error:
        warn(str(error))
        return None


def _built(
    source: str, key: str, outputs: int, compiler: Compiler, cache: Cache | None, warn: Warn
) -> Library:
    with TemporaryDirectory(prefix="vsacli-") as folder:
        text, library = Path(folder) / "program.c", Path(folder) / LIBRARY
        text.write_text(source, encoding="utf-8")
        compiler.build(text, library)
        loaded = Library(library, outputs)
        if cache is not None:
            try:
                cache.store(key, library)
            except CacheError as error:
                warn(f"{error}; compiled code is not kept")
        return loaded
