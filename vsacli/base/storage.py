"""What can be in the way of writing a file, and the sentences for it."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from vsacli.base.errors import StorageError
from vsacli.base.staging import remove, staging_name, sweep

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


@contextlib.contextmanager
def temporary_folder() -> Iterator[Path]:
    """A new folder, which goes with all that is in it at the end of the context.

    Those of killed processes are removed. What the disk refuses to take in it is told as a fault of the
    folder for temporary files, whatever the file there is called.

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


def check_target(path: str | Path, *, overwrite: bool | None) -> Path:
    """The file that `path` means, links followed, if it may be written.

    Args:
        path: the file.
        overwrite: whether it may be replaced; None if the command has no option for that.

    Raises:
        StorageError: it exists and may not be replaced, it is no regular file or has several names, or its
            folder does not exist.
    """
    with reporting_storage_errors(path):
        target = Path(os.path.realpath(path))
        if target.is_dir():
            raise StorageError(path, "is a folder; give the name of a file")
        if not target.parent.is_dir():
            raise StorageError(path, f"there is no folder {target.parent}; create it or choose another one")
        if target.exists() and not target.is_file():
            raise StorageError(path, "is not a regular file and cannot be replaced")
        if target.exists():
            if not overwrite:
                raise already_there(path, optional=overwrite is not None)
            _check_names(path, target)
    return target


def _check_names(path: str | Path, target: Path) -> None:
    """Refuse to replace a file of several names: the others would keep the old content.

    Raises:
        StorageError: it has several.
    """
    if target.stat().st_nlink > 1:
        sweep(target.parent)  # a run that was killed while it named this file has left it a second name
        if (names := target.stat().st_nlink) > 1:
            raise StorageError(
                path,
                f"has {names} names (hard links), of which only this one would get the new content; choose "
                "another name, or remove this one first",
            )


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


def reason(error: OSError) -> str:
    """What an operating system error says, a clause."""
    return _REASON.get(error.errno or 0, error.strerror or str(error))


def already_there(path: str | Path, *, optional: bool) -> StorageError:
    """What to say of a file that must not be replaced, by a command that may have an option for that."""
    advice = "replace it with --overwrite" if optional else "remove it first"
    return StorageError(path, f"exists already; choose another name, or {advice}")
