"""Names of files that are not finished, from which a later run knows whether somebody still works on them."""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import re
from functools import cache
from pathlib import Path

_NAME = re.compile(r"\.vsacli-(?P<host>[0-9a-f]{12})-(?P<process>\d+)-(?P<start>\d+)-[0-9a-f]{16}\.tmp")

UNKNOWN_START = 0
"""Of a process, where the system does not say when it began."""


def staging_name() -> str:
    """A hidden name that no other file has; it tells host, process, and when the process began."""
    process = os.getpid()
    return f".vsacli-{_host()}-{process}-{_start(process)}-{os.urandom(8).hex()}.tmp"


def sweep(folder: Path) -> None:
    """Remove what processes of this host left in a folder when they were killed.

    What belongs to a living process stays, and what comes from another host, whose processes nobody here
    can see: the folder may be on a network share.
    """
    with contextlib.suppress(OSError):
        for path in folder.iterdir():
            if abandoned(path.name):
                remove(path)


def abandoned(name: str) -> bool:
    """Whether a name is that of a staged file, of this host, whose process has ended."""
    found = _NAME.fullmatch(name)
    if found is None or found["host"] != _host():
        return False
    process = int(found["process"])
    try:
        os.kill(process, 0)  # asks only whether there is one
    except ProcessLookupError:
        return True
    except OSError:
        return False  # somebody else's
    return _start(process) != int(found["start"])  # the number of an ended process is used again


def remove(path: Path) -> None:
    """Remove a file or a folder, if it is there and the system allows it."""
    if path.is_dir():
        import shutil

        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


@cache
def _host() -> str:
    """This host, and what its numbers of processes refer to: containers may share a name."""
    try:
        namespace = os.readlink("/proc/self/ns/pid")
    except OSError:
        namespace = ""
    return hashlib.sha256(f"{platform.node()} {namespace}".encode()).hexdigest()[:12]


def _start(process: int) -> int:
    """When a process began, in clock ticks since the system did (proc(5))."""
    try:
        status = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return UNKNOWN_START
    return int(status.rpartition(")")[2].split()[19])  # field 22; the name, field 2, may hold spaces
