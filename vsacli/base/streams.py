"""What stands in for a file: `-` on a command line for a standard stream, a copy for an input of long ago."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from typing import IO

from vsacli.base.storage import reporting_temporary_errors

STANDARD = "-"
"""Stands for the stream; a file of that name is `./-`."""


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
    return _standard_input().name if name == STANDARD else name


@contextmanager
def reading_copies(copies: Mapping[str, str]) -> Iterator[None]:
    """Within this context, files of these paths are read elsewhere."""
    token = _copies.set(copies)
    try:
        yield
    finally:
        _copies.reset(token)


@cache
def _standard_input() -> IO[bytes]:
    """A temporary file that goes with the process: inputs are read more than once, to name lines."""
    import shutil
    import tempfile

    if sys.stdin is None:
        raise OSError(0, "standard input is closed")
    with reporting_temporary_errors():
        copy = tempfile.NamedTemporaryFile(prefix="vsacli-")  # noqa: SIM115 - it lasts as long as the process
    shutil.copyfileobj(sys.stdin.buffer, copy)
    copy.flush()
    return copy
