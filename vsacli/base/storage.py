"""Unfinished files and their names, temporary folders, and standard input.

The hidden name of an unfinished file identifies its process, so that a later run knows whether it is still
being written. An error of the operating system becomes a `StorageError` with a sentence about the file.
"""

from __future__ import annotations

import atexit
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
"""Name of a standard stream on a command line; a file of that name is given as `./-`."""

BYTES_PER_READ = 2**20

UNCHECKED_BYTES = 2**24
"""Size (bytes) below which free space is not checked, since writing such a file takes less time."""

_REASON_BY_ERRNO = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is exhausted",
    errno.EFBIG: "the file would exceed the largest file size allowed here",
    errno.EACCES: "no permission to write into this folder",
    errno.EROFS: "the file system is read-only",
    errno.ENAMETOOLONG: "the file name is too long",
    errno.EMFILE: "too many files are open; `ulimit -n 256` allows more",
}


@contextlib.contextmanager
def reporting_storage_errors(path: str | Path) -> Iterator[None]:
    """Turn an OSError of the enclosed statements into a StorageError about `path`."""
    try:
        yield
    except OSError as error:
        raise storage_error(path, error) from error


def storage_error(path: str | Path, error: OSError) -> StorageError:
    """Return the StorageError for an OSError raised while writing `path`."""
    return StorageError(path, f"cannot be written: {reason(error)}")


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
    if isinstance(error, FileNotFoundError) and error.filename is not None:  # else from `tempfile`
        return "no such file or folder"
    return _REASON_BY_ERRNO.get(error.errno or 0, error.strerror or str(error))


def check_free_space(path: str | Path, size: int) -> None:
    """Refuse a file that does not fit on its disk; sizes below `UNCHECKED_BYTES` are not checked.

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


_STAGING_NAME = re.compile(
    r"\.vsacli-(?P<host>[0-9a-f]{12})-(?P<process>\d+)-(?P<start>\d+)-[0-9a-f]{16}\.tmp"
)

UNKNOWN_START = 0
"""Start time of a process on systems that do not report it."""


class Owner(enum.StrEnum):
    """The owner of an unfinished file: a process of this host or of another one."""

    ENDED = "ended"
    RUNNING = "running"
    ELSEWHERE = "elsewhere"


class Unfinished(NamedTuple):
    """An unfinished file or folder.

    Attributes:
        path: the file.
        owner: state of the process that wrote it.
        size: bytes so far.
    """

    path: Path
    owner: Owner
    size: int


def staging_name() -> str:
    """Return a unique hidden name that identifies host, process, and start time of the process."""
    process = os.getpid()
    return f".vsacli-{_host_digest()}-{process}-{_process_start(process)}-{os.urandom(8).hex()}.tmp"


def sweep(folder: Path) -> None:
    """Remove unfinished files that killed processes of this host left in a folder.

    Files of running processes stay, and so do files from other hosts, whose processes cannot be seen from
    here: the folder may be on a network share.
    """
    for path, owner in _staged_files(folder):
        if owner is Owner.ENDED:
            remove(path)


def unfinished(folder: Path) -> list[Unfinished]:
    """Return the unfinished files of a folder, including those of killed processes."""
    return [Unfinished(path, owner, size_of(path)) for path, owner in sorted(_staged_files(folder))]


def _staged_files(folder: Path) -> list[tuple[Path, Owner]]:
    """Return each staged file of a folder with its owner; nothing if the folder cannot be read."""
    with contextlib.suppress(OSError):
        owners = ((path, owner_of(path.name)) for path in folder.iterdir())
        return [(path, owner) for path, owner in owners if owner is not None]
    return []


def owner_of(name: str) -> Owner | None:
    """Return the owner of a staged file by its name; None if it is not the name of one."""
    match = _STAGING_NAME.fullmatch(name)
    if match is None:
        return None
    if match["host"] != _host_digest():
        return Owner.ELSEWHERE
    process = int(match["process"])
    try:
        os.kill(process, 0)  # signal 0 only tests whether the process exists
    except ProcessLookupError:
        return Owner.ENDED
    except OSError:
        return Owner.RUNNING  # exists, but belongs to another user
    is_same_process = _process_start(process) == int(match["start"])
    return Owner.RUNNING if is_same_process else Owner.ENDED  # numbers of ended processes are reused


def size_of(path: Path) -> int:
    """Return the size in bytes of a file, or of all files in a folder; 0 if it no longer exists."""
    size = 0
    with contextlib.suppress(OSError):
        size = sum(map(size_of, path.iterdir())) if is_folder(path) else path.lstat().st_size
    return size


def is_folder(path: Path) -> bool:
    """Return whether a path is itself a folder, not a link to one."""
    return path.is_dir() and not path.is_symlink()


def remove(path: Path) -> None:
    """Remove a file or a folder, if it exists and the system allows it."""
    if is_folder(path):
        import shutil

        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


@cache
def _host_digest() -> str:
    """Return a digest of the host and its process namespace: containers may share a host name."""
    import hashlib

    try:
        namespace = os.readlink("/proc/self/ns/pid")
    except OSError:
        namespace = ""
    return hashlib.sha256(f"{platform.node()} {namespace}".encode()).hexdigest()[:12]


def _process_start(process: int) -> int:
    """Return the start time of a process, in clock ticks since boot (proc(5))."""
    try:
        status = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return UNKNOWN_START
    return int(status.rpartition(")")[2].split()[19])  # field 22; the name, field 2, may hold spaces


@contextlib.contextmanager
def temporary_folder() -> Iterator[Path]:
    """Create a folder that is removed with its content at the end of the context.

    Folders of killed processes are removed. Disk errors on files in it are reported for the folder for
    temporary files, since the user did not name those files.

    Raises:
        StorageError: the folder cannot be created, or its disk is full.
    """
    from tempfile import gettempdir

    with reporting_temporary_errors():
        parent = Path(gettempdir())
    sweep(parent)
    folder = parent / staging_name()
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


_copy_paths: ContextVar[Mapping[str, str]] = ContextVar("copies", default={})  # noqa: B039 - never changed


def place_of(path: str | os.PathLike[str]) -> str:
    """Return the path at which the content of a file can be read: its own, or that of a copy.

    Standard input has a copy, since it can be read only once; so have the files of `reading_copies`.

    Raises:
        OSError: standard input is closed, or cannot be read.
        StorageError: the disk has no room for the copy.
    """
    name = os.fspath(path)
    copies = _copy_paths.get()
    if name in copies:
        return copies[name]
    return _standard_input() if name == STANDARD else name


@contextlib.contextmanager
def reading_copies(copies: Mapping[str, str]) -> Iterator[None]:
    """Read files of these paths from copies within this context."""
    token = _copy_paths.set(copies)
    try:
        yield
    finally:
        _copy_paths.reset(token)


@cache
def _standard_input() -> str:
    """Copy standard input to a file, removed at exit: inputs are read more than once, to name lines."""
    if sys.stdin is None:
        raise OSError(0, "standard input is closed")
    cleanup = contextlib.ExitStack()
    atexit.register(cleanup.close)
    copy = cleanup.enter_context(temporary_folder()) / "stdin"
    with reporting_temporary_errors():
        file = cleanup.enter_context(copy.open("wb", buffering=0))
    while chunk := sys.stdin.buffer.read(BYTES_PER_READ):
        with reporting_temporary_errors():
            file.write(chunk)
    return str(copy)
