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
from vsacli.compute.engine.trial import Trying, check_library

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
        linear, squares = sum(self.functions), sum(count**2 for count in self.functions)
        needed = COMPILER_SECONDS_PER_OPERATION * linear + COMPILER_SECONDS_PER_SQUARE * squares
        return COMPILER_START_SECONDS + needed

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
    opened: Callable[[Path], _Opened],
    compiler: Compiler,
    tell: Tell,
    trying: Trying,
    worthwhile: Worthwhile = lambda _code: True,
) -> Loaded[_Opened] | None:
    """Return the library of some code; None if it is not cached and not worth compiling.

    Args:
        code: Code to compile.
        opened: Function that loads a library, equal for equal code; the file may be removed once loaded.
        compiler: Compiler to use.
        tell: Callback for problems with the cache, which are no errors, and announcements of long work.
        trying: Trial of new code; only code that passes is loaded and kept.
        worthwhile: Whether to compile code that is not in the cache.

    Raises:
        CompilerError: The code cannot be compiled or loaded, or fails its trial.
    """
    key = key_of(code.text, compiler.identity)
    if key not in _loaded:
        cache = _open_cache(tell)
        kept = None if cache is None else _found(cache, key, opened, tell)
        if kept is not None:
            _loaded[key] = Loaded(kept, compiled=False)
        elif worthwhile(code):
            _announce(code, tell)
            _loaded[key] = Loaded(
                _built(code.text, key, opened, compiler, trying, cache, tell), compiled=True
            )
    return _loaded.get(key)


def _announce(code: Code, tell: Tell) -> None:
    """Announce a compilation that takes long.

    Raises:
        CompilerError: It takes too long.
    """
    seconds = code.compiling_seconds
    if code.takes_too_long:
        count = sum(code.functions)
        raise CompilerError(
            f"compiling {count} operations would take about {seconds:.0f} s, more than {TIMEOUT:g} s"
        )
    if seconds > LONG_SECONDS:
        tell(f"compiling takes about {seconds:.0f} s, this once (at most {TIMEOUT:g} s)")


_loaded: dict[str, Loaded[Any]] = {}
"""Libraries loaded by this process, by key."""


def _open_cache(tell: Tell) -> Cache | None:
    try:
        return open_cache()
    except CacheError as error:
        tell(f"{error}; compiled code is not kept")
        return None


def _found(cache: Cache, key: str, opened: Callable[[Path], _Opened], tell: Tell) -> _Opened | None:
    try:
        path = cache.find(key)
        return None if path is None else opened(path)
    except CacheError as error:
        tell(str(error))
    except CompilerError as error:  # such as a folder mounted noexec
        tell(f"{error}; it is compiled anew")
    return None


def _built(
    source: str,
    key: str,
    opened: Callable[[Path], _Opened],
    compiler: Compiler,
    trying: Trying,
    cache: Cache | None,
    tell: Tell,
) -> _Opened:
    try:
        with temporary_folder() as folder:
            text, library = folder / "program.c", folder / LIBRARY
            with reporting_temporary_errors():
                text.write_text(source, encoding="utf-8")
            compiler.build(text, library)
            check_library(library, trying())
            loaded = opened(library)
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
