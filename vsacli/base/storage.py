"""Unfinished files and their names, temporary folders, and standard input.

The hidden name of an unfinished file tells its process, so that a later run knows whether somebody still
works on it. An error of the operating system becomes a `StorageError` with a sentence about the file.
"""

from __future__ import annotations

import contextlib
import enum
import errno
import os
import platform
import re
import sys
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from typing import NamedTuple

from vsacli.base.errors import StorageError

STANDARD = "-"
"""Stands for a standard stream on a command line; a file of that name is `./-`."""

BYTES_PER_READ = 2**20

UNCHECKED_BYTES = 2**24
"""Size up to which a file is sooner written than its disk is asked for room."""

_REASON = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is exhausted",
    errno.EFBIG: "the file would exceed the largest file size allowed here",
    errno.EACCES: "no permission to write into this folder",
    errno.EROFS: "the file system is read-only",
    errno.ENAMETOOLONG: "the file name is too long",
}


@contextlib.contextmanager
def reporting_storage_errors(path: str | Path) -> Iterator[None]:
    """Turn an OSError of the enclosed statements into a StorageError about `path`."""
    try:
        yield
    except OSError as error:
        raise storage_error(path, error) from error


def storage_error(path: str | Path, error: OSError) -> StorageError:
    """Return the sentence for an operating system error met while writing `path`."""
    return StorageError(path, f"cannot be written: {reason(error)}; nothing was changed there")


@contextlib.contextmanager
def reporting_temporary_errors() -> Iterator[None]:
    """Turn an OSError of the enclosed statements into a StorageError about the folder for temporary files."""
    try:
        yield
    except OSError as error:
        advice = "name another one by the environment variable TMPDIR"
        message = f"cannot be used: {reason(error)}; {advice}"
        raise StorageError("folder for temporary files", message) from error


def reason(error: OSError) -> str:
    """Return an operating system error as a clause."""
    return _REASON.get(error.errno or 0, error.strerror or str(error))


def check_free_space(path: str | Path, size: int) -> None:
    """Refuse a file of `size` bytes that its disk has no room for, from `UNCHECKED_BYTES` on.

    Raises:
        StorageError: with both sizes in MB.
    """
    if size < UNCHECKED_BYTES:
        return
    import shutil

    with reporting_storage_errors(path):
        free = shutil.disk_usage(Path(os.path.realpath(path)).parent).free
    if size > free:
        raise StorageError(
            path,
            f"needs {size / 1e6:.0f} MB, but the disk has {free / 1e6:.0f} MB left; "
            "free some space, or store fewer variables with --variables",
        ) from OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


_NAME = re.compile(r"\.vsacli-(?P<host>[0-9a-f]{12})-(?P<process>\d+)-(?P<start>\d+)-[0-9a-f]{16}\.tmp")

UNKNOWN_START = 0
"""Start of a process on systems that do not tell it."""


class Owner(enum.StrEnum):
    """The owner of an unfinished file: a process of this host or another one."""

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
    """Return a hidden name of its own; it tells host, process, and when the process began."""
    process = os.getpid()
    return f".vsacli-{_host()}-{process}-{_start(process)}-{os.urandom(8).hex()}.tmp"


def sweep(folder: Path) -> None:
    """Remove unfinished files in a folder that killed processes of this host left there.

    Files of living processes stay, and files from other hosts, whose processes cannot be seen from here: the
    folder may be on a network share.
    """
    for path, owner in _staged(folder):
        if owner is Owner.ENDED:
            remove(path)


def unfinished(folder: Path) -> list[Unfinished]:
    """Return the unfinished files of a folder, also those of killed processes."""
    return [Unfinished(path, owner, size_of(path)) for path, owner in sorted(_staged(folder))]


def _staged(folder: Path) -> list[tuple[Path, Owner]]:
    """Return each staged file of a folder, if it can be read, with its owner."""
    with contextlib.suppress(OSError):
        owners = ((path, owner_of(path.name)) for path in folder.iterdir())
        return [(path, owner) for path, owner in owners if owner is not None]
    return []


def owner_of(name: str) -> Owner | None:
    """Return who works on a staged file of a name; None if it is no such name."""
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
    """Return the bytes of a file, or of all files in a folder; 0 if it has gone."""
    size = 0
    with contextlib.suppress(OSError):
        size = sum(map(size_of, path.iterdir())) if is_folder(path) else path.lstat().st_size
    return size


def is_folder(path: Path) -> bool:
    """Return whether a path is a folder itself, no link to one."""
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
    """Return a digest of the host and its namespace of process numbers: containers may share a host name."""
    import hashlib

    try:
        namespace = os.readlink("/proc/self/ns/pid")
    except OSError:
        namespace = ""
    return hashlib.sha256(f"{platform.node()} {namespace}".encode()).hexdigest()[:12]


def _start(process: int) -> int:
    """Return when a process began, in clock ticks since the system did (proc(5))."""
    try:
        status = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return UNKNOWN_START
    return int(status.rpartition(")")[2].split()[19])  # field 22; the name, field 2, may hold spaces


@contextlib.contextmanager
def temporary_folder() -> Iterator[Path]:
    """Make a folder that is removed with its content at the end of the context.

    Folders of killed processes are removed. An error of the disk is reported as one of the folder for
    temporary files, whatever the file in it is called.

    Raises:
        StorageError: there is no place for one, or not enough of it.
    """
    from tempfile import gettempdir

    with reporting_temporary_errors():
        place = Path(gettempdir())
    sweep(place)
    folder = place / staging_name()
    try:
        with reporting_temporary_errors():
            folder.mkdir(mode=0o700)
        try:
            yield folder
        except StorageError as error:
            if isinstance(error.__cause__, OSError) and Path(error.path).is_relative_to(folder):
                with reporting_temporary_errors():
                    raise error.__cause__ from None
            raise
    finally:
        remove(folder)


_copies: ContextVar[Mapping[str, str]] = ContextVar("copies", default={})  # noqa: B039 - never changed


def place_of(path: str | os.PathLike[str]) -> str:
    """Return where the content of a file can be read: at its path, or in a copy.

    Standard input has a copy, since it can be read only once, and so have files of `reading_copies`.

    Raises:
        OSError: standard input is closed, or cannot be read.
        StorageError: there is no room for the copy.
    """
    name = os.fspath(path)
    copies = _copies.get()
    if name in copies:
        return copies[name]
    return _standard_input() if name == STANDARD else name


@contextlib.contextmanager
def reading_copies(copies: Mapping[str, str]) -> Iterator[None]:
    """Within this context, files of these paths are read elsewhere."""
    token = _copies.set(copies)
    try:
        yield
    finally:
        _copies.reset(token)


@cache
def _standard_input() -> str:
    """Return a copy that goes with the process: inputs are read more than once, to name lines."""
    import atexit

    if sys.stdin is None:
        raise OSError(0, "standard input is closed")
    kept = contextlib.ExitStack()
    atexit.register(kept.close)
    copy = kept.enter_context(temporary_folder()) / "stdin"
    with reporting_temporary_errors():
        file = kept.enter_context(copy.open("wb", buffering=0))
    while piece := sys.stdin.buffer.read(BYTES_PER_READ):
        with reporting_temporary_errors():
            file.write(piece)
    return str(copy)
