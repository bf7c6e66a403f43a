"""Files that a command writes: staged next to their targets, and published together or not at all."""

from __future__ import annotations

import contextlib
import itertools
import os
import stat
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from vsacli.base.errors import InputError, StorageError
from vsacli.base.interrupts import interrupts_deferred
from vsacli.base.storage import STANDARD, remove, reporting_storage_errors, staging_name, sweep


@dataclass(frozen=True)
class Staged:
    """An output file or folder that is not yet published. A full or failing disk raises a StorageError.

    Attributes:
        path: name as given by the user.
        target: file that the name refers to, links resolved.
        temporary: file to write meanwhile; it exists, with the permissions of the umask.
    """

    path: Path
    target: Path
    temporary: Path

    @classmethod
    def unnamed(cls, path: Path) -> Staged:
        """Create a file in a temporary folder, together with which it is removed."""
        with reporting_storage_errors(path):
            path.touch()
        return cls(path, path, path)

    @contextlib.contextmanager
    def opened(self, *, binary: bool = False) -> Iterator[Any]:
        """Open for bytes, or for text without translation of line ends."""
        open_options: dict[str, Any] = (
            {"mode": "wb"} if binary else {"mode": "w", "encoding": "utf-8", "newline": ""}
        )
        with reporting_storage_errors(self.path), self.temporary.open(**open_options) as stream:
            yield stream

    def write_text(self, text: str) -> None:
        """Write a text as UTF-8."""
        self.write_bytes(text.encode("utf-8"))

    def write_bytes(self, content: bytes) -> None:
        """Write bytes."""
        with self.opened(binary=True) as stream:
            stream.write(content)


class Outputs:
    """Context manager around all files that a command writes.

    Files are checked and staged when they are named, before anything is computed. When the context is left
    without an exception, they all get their names, or none does if one cannot. A new folder appears with its
    whole content. From then on the run counts as done and signals no longer end it: a run reported as
    interrupted has published nothing. A killed process leaves only hidden files, which the next command in
    that folder removes, unless it is killed while files get their names in an existing folder: then only some
    have theirs.

    Args:
        overwrite: whether existing files may be replaced; None if the command has no option for that.
        inputs: files that the command reads, which it never replaces.
    """

    def __init__(self, *, overwrite: bool | None = None, inputs: Iterable[str | Path] = ()) -> None:
        self._overwrite = overwrite
        self._inputs = tuple(inputs)
        self._files: list[Staged] = []
        self._folders: dict[Path, Staged] = {}
        self._temporaries: list[Path] = []

    def __enter__(self) -> Self:
        return self

    def file(self, path: str | Path) -> Staged:
        """Stage a file.

        Raises:
            StorageError: the file exists and must not be replaced, or is not a regular file; or its folder is
                neither there nor requested, or cannot be written to.
            InputError: the command reads the file, or already writes one of this name.
        """
        target = self.check(path)
        staged = self._path_in_new_folder(target) or self._new_staging_path(target)
        with reporting_storage_errors(path):
            staged.open("xb").close()
        self._files.append(Staged(Path(path), target, staged))
        return self._files[-1]

    def check(self, path: str | Path) -> Path:
        """Refuse a path that cannot be staged; return the file it refers to, links resolved.

        Raises:
            StorageError, InputError: as `file`.
        """
        if str(path) == STANDARD:
            raise InputError.one("standard output cannot hold this; name a file", path)
        with reporting_storage_errors(path):
            target = Path(os.path.realpath(path))
        if any(target == file.target for file in self._files):
            raise InputError.one("would be written twice by this command; choose different names", path)
        if self._path_in_new_folder(target) is None:
            existing_inputs = [file for file in self._inputs if os.path.exists(file)]
            if os.path.exists(path) and any(os.path.samefile(path, file) for file in existing_inputs):
                message = "is an input of this command; choose another name for the output"
                raise InputError.one(message, path)
            with reporting_storage_errors(path):
                _check_target(path, target, overwrite=self._overwrite)
        return target

    def folder(self, path: str | Path) -> None:
        """Request a folder, which is created if it does not exist.

        Raises:
            StorageError: a file has that name, or the folder cannot be created.
        """
        with reporting_storage_errors(path):
            target = Path(os.path.realpath(path))
            if target.is_dir():
                return
            staged = self._path_in_new_folder(target)
            if staged is None:
                folders_with_parents = itertools.pairwise([target, *target.parents])
                outermost_new = next(folder for folder, parent in folders_with_parents if parent.is_dir())
                if outermost_new.exists():
                    finding = "is a file" if outermost_new == target else f"{outermost_new.name} is a file"
                    raise StorageError(path, f"{finding}; name a folder")
                self._folders[outermost_new] = Staged(
                    Path(path), outermost_new, self._new_staging_path(outermost_new)
                )
                staged = self._folders[outermost_new].temporary / target.relative_to(outermost_new)
            staged.mkdir(parents=True, exist_ok=True)

    @property
    def paths(self) -> tuple[Path, ...]:
        """Paths of the files, in the order in which they were named."""
        return tuple(file.path for file in self._files)

    def _path_in_new_folder(self, target: Path) -> Path | None:
        """Return the place of a file or folder in a new folder that is staged; None if it belongs to none."""
        for folder in self._folders.values():
            if target.is_relative_to(folder.target):
                return folder.temporary / target.relative_to(folder.target)
        return None

    def _new_staging_path(self, target: Path) -> Path:
        """Return a temporary name next to a target; remove leftovers of earlier runs from that folder."""
        if all(target.parent != temporary.parent for temporary in self._temporaries):
            sweep(target.parent)
        self._temporaries.append(target.with_name(staging_name()))
        return self._temporaries[-1]

    def __exit__(
        self,
        error_type: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            if error_type is None:
                self._publish()
        finally:
            for path in self._temporaries:
                remove(path)

    def _publish(self) -> None:
        """Give all files their names, once on the disk; if one cannot be named, none keeps its name."""
        for file in self._files:
            with reporting_storage_errors(file.path):
                _sync(file.temporary, os.O_RDWR)
        with interrupts_deferred() as interrupts, contextlib.ExitStack() as undo:
            for folder in self._folders.values():
                with reporting_storage_errors(folder.path):
                    folder.temporary.rename(folder.target)
                undo.callback(folder.target.rename, folder.temporary)
            for file in self._files:
                if file.temporary in self._temporaries:
                    with reporting_storage_errors(file.path):
                        self._publish_file(file, undo)
            undo.pop_all()
            if self._files:
                interrupts.disregard()
        for parent in {path.parent for path in self._temporaries}:
            with contextlib.suppress(OSError):  # some file systems cannot sync a folder
                _sync(parent, os.O_RDONLY)

    def _publish_file(self, file: Staged, undo: contextlib.ExitStack) -> None:
        if self._overwrite and file.target.exists():
            backup = self._new_staging_path(file.target)
            try:
                os.link(file.target, backup)
            except OSError:  # no hard links here (exFAT, some network shares)
                import shutil

                shutil.copy2(file.target, backup)
            _take_permissions(file.temporary, file.target.stat())
            file.temporary.replace(file.target)
            undo.callback(backup.replace, file.target)
        else:
            _name_without_replacing(file, optional=self._overwrite is not None)
            undo.callback(file.target.unlink)


def _check_target(path: str | Path, target: Path, *, overwrite: bool | None) -> None:
    """Refuse a target that is not a regular file, may not be replaced, or has several hard links."""
    if target.is_dir():
        raise StorageError(path, "is a folder; give the name of a file")
    if not target.parent.is_dir():
        raise StorageError(path, f"there is no folder {target.parent}; create it or choose another one")
    if not target.exists():
        return
    if not target.is_file():
        raise StorageError(path, "is not a regular file and cannot be replaced")
    if not overwrite:
        raise _existing_file_error(path, optional=overwrite is not None)
    if target.stat().st_nlink > 1:
        sweep(target.parent)  # a run that was killed while it named this file has left it a second name
        if (names := target.stat().st_nlink) > 1:  # the others would keep the old content
            raise StorageError(
                path,
                f"has {names} names (hard links), of which only this one would get the new content; choose "
                "another name, or remove this one first",
            )


def _existing_file_error(path: str | Path, *, optional: bool) -> StorageError:
    """Return the error for an existing file; the advice depends on whether the command can replace it."""
    advice = "replace it with --overwrite" if optional else "remove it first"
    return StorageError(path, f"exists already; choose another name, or {advice}")


def _take_permissions(path: Path, replaced_status: os.stat_result) -> None:
    """Give a file the owner, group and mode of the file that it replaces, as far as the system permits.

    If the group cannot be set, members of the file's own group are strangers: they get no more rights than
    others have.
    """
    mode, status = stat.S_IMODE(replaced_status.st_mode), path.stat()
    if hasattr(os, "chown"):
        if replaced_status.st_gid != status.st_gid and not _try_change(
            os.chown, path, -1, replaced_status.st_gid
        ):
            mode &= ~stat.S_IRWXG | (mode & stat.S_IRWXO) << 3
        if replaced_status.st_uid != status.st_uid:
            _try_change(os.chown, path, replaced_status.st_uid, -1)
    _try_change(path.chmod, mode)  # last, since a change of owner clears the setuid bit


def _try_change(change: Callable[..., None], *arguments: object) -> bool:
    try:
        change(*arguments)
    except OSError:  # no permission, or a file system without owners
        return False
    return True


def _name_without_replacing(file: Staged, *, optional: bool) -> None:
    """Name a file without ever replacing another one, unlike a rename."""
    try:
        os.link(file.temporary, file.target)
    except FileExistsError as error:
        raise _existing_file_error(file.path, optional=optional) from error
    except OSError as error:  # no hard links here
        if file.target.exists():
            raise _existing_file_error(file.path, optional=optional) from error
        file.temporary.replace(file.target)


def _sync(path: Path, mode: int) -> None:
    descriptor = os.open(path, mode)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
