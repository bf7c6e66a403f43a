"""Shared libraries of C code: loaded from the cache, or compiled and tried."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from vsacli.base.errors import StorageError
from vsacli.base.progress import Tell
from vsacli.base.storage import reporting_temporary_errors, temporary_folder
from vsacli.compute.engine.cache import LIBRARY, Cache, CacheError, key_of, open_cache
from vsacli.compute.engine.compiler import TIMEOUT, Compiler, CompilerError
from vsacli.compute.engine.costs import (
    COMPILED_SECONDS,
    COMPILER_SECONDS_PER_OPERATION,
    COMPILER_SECONDS_PER_SQUARE,
    COMPILER_START_SECONDS,
    TRACED_SECONDS,
    UNTRACED_SECONDS,
)
from vsacli.compute.engine.trial import TrialFactory, check_library

LONG_SECONDS = 5.0
"""Estimated time of the compiler, s, from which on it is announced to the user."""

_Opened = TypeVar("_Opened")


class Code(NamedTuple):
    """C code, and its cost.

    Attributes:
        text: Source text.
        operations: Usual number of operations per sample.
        functions: Number of operations of each function, with `CONDITIONAL_OPERATIONS`.
        straight: Whether there are no loops and branches, so that NumPy can also run the traced program.
    """

    text: str
    operations: int
    functions: tuple[int, ...]
    straight: bool = True

    @property
    def seconds_saved(self) -> float:
        """Estimated time that compiled code saves for each sample, compared with NumPy, s."""
        numpy = TRACED_SECONDS if self.straight else UNTRACED_SECONDS
        return self.operations * (numpy - COMPILED_SECONDS)

    @property
    def compiling_seconds(self) -> float:
        """Estimated time of the compiler, s."""
        operations, squared = sum(self.functions), sum(count**2 for count in self.functions)
        seconds = COMPILER_SECONDS_PER_OPERATION * operations + COMPILER_SECONDS_PER_SQUARE * squared
        return COMPILER_START_SECONDS + seconds

    @property
    def takes_too_long(self) -> bool:
        """Whether the compiler would exceed `TIMEOUT`."""
        return self.compiling_seconds > TIMEOUT


Worthwhile = Callable[[Code], bool]
"""Predicate: whether compiling code pays off."""


class Loaded(NamedTuple, Generic[_Opened]):
    """A library, and whether it had to be compiled for this process."""

    library: _Opened
    compiled: bool


def load(
    code: Code,
    open_library: Callable[[Path], _Opened],
    compiler: Compiler,
    tell: Tell,
    make_trial: TrialFactory,
    worthwhile: Worthwhile = lambda _code: True,
) -> Loaded[_Opened] | None:
    """Return the library of some code; None if it is not cached and not worth compiling.

    Args:
        code: Code to compile.
        open_library: Function that loads a library, equal for equal code; the file may then be removed.
        compiler: Compiler to use.
        tell: Callback for problems with the cache, which are no errors, and announcements of long work.
        make_trial: Trial of new code; only code that passes is loaded and kept.
        worthwhile: Whether to compile code that is not in the cache.

    Raises:
        CompilerError: The code cannot be compiled or loaded, or fails its trial.
    """
    key = key_of(code.text, compiler.identity)
    if key not in _loaded_libraries:
        cache = _cache_if_usable(tell)
        cached = None if cache is None else _load_cached(cache, key, open_library, tell)
        if cached is not None:
            _loaded_libraries[key] = Loaded(cached, compiled=False)
        elif worthwhile(code):
            _announce_compilation(code, tell)
            _loaded_libraries[key] = Loaded(
                _build_library(code.text, key, open_library, compiler, make_trial, cache, tell), compiled=True
            )
    return _loaded_libraries.get(key)


def _announce_compilation(code: Code, tell: Tell) -> None:
    """Announce a compilation that takes long.

    Raises:
        CompilerError: It takes too long.
    """
    seconds = code.compiling_seconds
    if code.takes_too_long:
        operations = sum(code.functions)
        raise CompilerError(
            f"compiling {operations} operations would take about {seconds:.0f} s, more than {TIMEOUT:g} s"
        )
    if seconds > LONG_SECONDS:
        tell(f"compiling takes about {seconds:.0f} s, this once (at most {TIMEOUT:g} s)")


_loaded_libraries: dict[str, Loaded[Any]] = {}
"""Libraries loaded by this process, by key."""


def _cache_if_usable(tell: Tell) -> Cache | None:
    try:
        return open_cache()
    except CacheError as error:
        tell(f"{error}; compiled code is not kept")
        return None


def _load_cached(
    cache: Cache, key: str, open_library: Callable[[Path], _Opened], tell: Tell
) -> _Opened | None:
    try:
        path = cache.find(key)
        return None if path is None else open_library(path)
    except CacheError as error:
        tell(str(error))
    except CompilerError as error:  # such as a folder mounted noexec
        tell(f"{error}; it is compiled anew")
    return None


def _build_library(
    source: str,
    key: str,
    open_library: Callable[[Path], _Opened],
    compiler: Compiler,
    make_trial: TrialFactory,
    cache: Cache | None,
    tell: Tell,
) -> _Opened:
    try:
        with temporary_folder() as folder:
            source_path, library_path = folder / "program.c", folder / LIBRARY
            with reporting_temporary_errors():
                source_path.write_text(source, encoding="utf-8")
            compiler.build(source_path, library_path)
            check_library(library_path, make_trial())
            opened_library = open_library(library_path)
            if cache is not None:
                _store_library(cache, key, library_path, tell)
            return opened_library
    except StorageError as error:
        raise CompilerError(str(error)) from None


def _store_library(cache: Cache, key: str, library_path: Path, tell: Tell) -> None:
    try:
        cache.store(key, library_path)
    except CacheError as error:
        tell(f"{error}; compiled code is not kept")
