"""What stands in for a file: `-` on a command line for a standard stream, a copy for an input of long ago."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from functools import cache

from vsacli.base.storage import reporting_temporary_errors, temporary_folder

STANDARD = "-"
"""Stands for the stream; a file of that name is `./-`."""

BYTES_PER_READ = 2**20


_copies: ContextVar[Mapping[str, str]] = ContextVar("copies", default={})  # noqa: B039 - never changed


def place_of(path: str | os.PathLike[str]) -> str:
    """Where to find what a file holds: at its path, or in a copy.

    Standard input has one, since it can be read only once, and whatever `reading_copies` says.

    Raises:
        OSError: standard input is closed, or cannot be read.
        StorageError: there is no room for the copy.
    """
    name = os.fspath(path)
    copies = _copies.get()
    if name in copies:
        return copies[name]
    return _standard_input() if name == STANDARD else name


@contextmanager
def reading_copies(copies: Mapping[str, str]) -> Iterator[None]:
    """Within this context, files of these paths are read elsewhere."""
    token = _copies.set(copies)
    try:
        yield
    finally:
        _copies.reset(token)


@cache
def _standard_input() -> str:
    """A copy that goes with the process: inputs are read more than once, to name lines."""
    import atexit

    if sys.stdin is None:
        raise OSError(0, "standard input is closed")
    kept = ExitStack()
    atexit.register(kept.close)
    copy = kept.enter_context(temporary_folder()) / "stdin"
    with reporting_temporary_errors():
        file = kept.enter_context(copy.open("wb", buffering=0))
    while piece := sys.stdin.buffer.read(BYTES_PER_READ):
        with reporting_temporary_errors():
            file.write(piece)
    return str(copy)
