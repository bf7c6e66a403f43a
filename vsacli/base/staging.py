"""Names of files that are not finished, from which a later run knows whether somebody still works on them."""

from __future__ import annotations

import contextlib
import enum
import os
import platform
import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

_NAME = re.compile(r"\.vsacli-(?P<host>[0-9a-f]{12})-(?P<process>\d+)-(?P<start>\d+)-[0-9a-f]{16}\.tmp")

UNKNOWN_START = 0
"""Of a process, where the system does not say when it began."""


class Owner(enum.StrEnum):
    """Who works on a file that is not finished: a process of this host or another one."""

    ENDED = "ended"
    RUNNING = "running"
    ELSEWHERE = "elsewhere"


class Unfinished(NamedTuple):
    """A file, or a folder of them, that is not finished.

    Attributes:
        path: the file.
        owner: who works on it.
        size: bytes so far.
    """

    path: Path
    owner: Owner
    size: int


def staging_name() -> str:
    """A hidden name that no other file has; it tells host, process, and when the process began."""
    process = os.getpid()
    return f".vsacli-{_host()}-{process}-{_start(process)}-{os.urandom(8).hex()}.tmp"


def sweep(folder: Path) -> None:
    """Remove what processes of this host left in a folder when they were killed.

    What belongs to a living process stays, and what comes from another host, whose processes nobody here
    can see: the folder may be on a network share.
    """
    for path, owner in _staged(folder):
        if owner is Owner.ENDED:
            remove(path)


def unfinished(folder: Path) -> list[Unfinished]:
    """What is not finished in a folder, or was left there."""
    return [Unfinished(path, owner, size_of(path)) for path, owner in sorted(_staged(folder))]


def _staged(folder: Path) -> list[tuple[Path, Owner]]:
    """Each staged file of a folder, if it can be read, with its owner."""
    with contextlib.suppress(OSError):
        owners = ((path, owner_of(path.name)) for path in folder.iterdir())
        return [(path, owner) for path, owner in owners if owner is not None]
    return []


def owner_of(name: str) -> Owner | None:
    """Who works on a staged file of a name; None if it is no such name."""
    found = _NAME.fullmatch(name)
    if found is None:
        return None
    if found["host"] != _host():
        return Owner.ELSEWHERE
    process = int(found["process"])
    try:
        os.kill(process, 0)  # asks only whether there is one
    except ProcessLookupError:
        return Owner.ENDED
    except OSError:
        return Owner.RUNNING  # somebody else's
    same = _start(process) == int(found["start"])
    return Owner.RUNNING if same else Owner.ENDED  # the number of an ended process is used again


def size_of(path: Path) -> int:
    """Bytes of a file, or of all files in a folder; 0 if it has gone."""
    size = 0
    with contextlib.suppress(OSError):
        size = sum(map(size_of, path.iterdir())) if is_folder(path) else path.lstat().st_size
    return size


def is_folder(path: Path) -> bool:
    """Whether a path is a folder itself, no link to one."""
    return path.is_dir() and not path.is_symlink()


def remove(path: Path) -> None:
    """Remove a file or a folder, if it is there and the system allows it."""
    if is_folder(path):
        import shutil

        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


@cache
def _host() -> str:
    """This host, and what its numbers of processes refer to: containers may share a name."""
    import hashlib

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
