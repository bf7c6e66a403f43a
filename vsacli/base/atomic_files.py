"""Files that appear under their name only when they are complete."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

from vsacli.base.errors import StorageError

_REASON = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is exhausted",
    errno.EFBIG: "the file would exceed the largest file size allowed here",
    errno.EACCES: "no permission to write into this folder",
    errno.EROFS: "the file system is read-only",
    errno.ENAMETOOLONG: "the file name is too long",
}


UNCHECKED_BYTES = 2**24
"""Size up to which a file is sooner written than its disk is asked for room."""


@contextlib.contextmanager
def reporting_storage_errors(path: str | Path) -> Iterator[None]:
    """Turn an OSError of the enclosed statements into a StorageError about `path`."""
    try:
        yield
    except OSError as error:
        raise storage_error(path, error) from error


def storage_error(path: str | Path, error: OSError) -> StorageError:
    """The sentence for an operating system error met while writing `path`."""
    reason = _REASON.get(error.errno or 0, error.strerror or str(error))
    return StorageError(path, f"cannot be written: {reason}; nothing was changed there")


def check_target(path: str | Path, *, overwrite: bool) -> Path:
    """The file that `path` means, links followed, if it may be written.

    Raises:
        StorageError: it exists and `overwrite` is false, it is no regular file, or its folder does not exist.
    """
    with reporting_storage_errors(path):
        target = Path(os.path.realpath(path))
        if target.is_dir():
            raise StorageError(path, "is a folder; give the name of a file")
        if not target.parent.is_dir():
            raise StorageError(path, f"there is no folder {target.parent}; create it or choose another one")
        if target.exists() and not target.is_file():
            raise StorageError(path, "is not a regular file and cannot be replaced")
        if target.exists() and not overwrite:
            raise already_there(path)
    return target


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
        )


class AtomicFile:
    """Context manager around a temporary file in the folder of its target.

    `publish` moves the file to its target; leaving the context without it, for whatever reason, removes it.
    A process that is killed leaves at most the hidden temporary, never part of a target.

    Attributes:
        target: the file to be, links followed.
        temporary: the hidden file to write in the meantime; it exists, is empty, and obeys the umask.
    """

    def __init__(self, path: str | Path, *, overwrite: bool = False) -> None:
        self._path = path
        self._overwrite = overwrite

    def __enter__(self) -> Self:
        """Create the temporary.

        Raises:
            StorageError: as `check_target`, or if the folder cannot be written.
        """
        self.target = check_target(self._path, overwrite=self._overwrite)
        self.temporary = self.target.with_name(f".vsacli-{os.urandom(8).hex()}.tmp")
        with reporting_storage_errors(self._path):
            self.temporary.open("xb").close()
        return self

    def publish(self) -> None:
        """Give the finished file its name, after it has reached the disk.

        Raises:
            StorageError: the disk fails, or a file of that name has appeared meanwhile.
        """
        with reporting_storage_errors(self._path):
            _sync(self.temporary, os.O_RDWR)
            if self._overwrite:
                self.temporary.replace(self.target)
            else:
                self._link()
        with contextlib.suppress(OSError):  # the file is complete; some file systems cannot sync a folder
            _sync(self.target.parent, os.O_RDONLY)

    def _link(self) -> None:
        """Name the file without ever replacing another one, which a rename would."""
        try:
            os.link(self.temporary, self.target)
        except FileExistsError as error:
            raise already_there(self._path) from error
        except OSError as error:  # no hard links on this file system (exFAT, some network shares)
            if self.target.exists():
                raise already_there(self._path) from error
            self.temporary.replace(self.target)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        with contextlib.suppress(OSError):
            self.temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str, *, overwrite: bool = False) -> None:
    """Write a text file, all of it or nothing.

    Raises:
        StorageError: as `AtomicFile`.
    """
    with AtomicFile(path, overwrite=overwrite) as file:
        with reporting_storage_errors(path):
            file.temporary.write_text(text, encoding="utf-8")
        file.publish()


def already_there(path: str | Path) -> StorageError:
    """What to say of a file that must not be replaced."""
    return StorageError(path, "exists already; choose another name, or replace it with --overwrite")


def _sync(path: Path, mode: int) -> None:
    descriptor = os.open(path, mode)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
