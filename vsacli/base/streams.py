"""`-` on a command line: standard input or output in place of a file."""

from __future__ import annotations

import os
import sys
from functools import cache
from typing import IO

STANDARD = "-"
"""Stands for the stream; a file of that name is `./-`."""


def place_of(path: str | os.PathLike[str]) -> str:
    """Where to find what a file holds: at its path, or in a copy of standard input, which is read once.

    Raises:
        OSError: standard input is closed, or there is no room for the copy.
    """
    name = os.fspath(path)
    return _standard_input().name if name == STANDARD else name


@cache
def _standard_input() -> IO[bytes]:
    """A temporary file that goes with the process: inputs are read more than once, to name lines."""
    import shutil
    import tempfile

    if sys.stdin is None:
        raise OSError(0, "standard input is closed")
    copy = tempfile.NamedTemporaryFile(prefix="vsacli-")  # noqa: SIM115 - it lasts as long as the process
    shutil.copyfileobj(sys.stdin.buffer, copy)
    copy.flush()
    return copy
