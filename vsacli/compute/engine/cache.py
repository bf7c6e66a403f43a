"""Cache of compiled libraries in a folder of the user; files of other users, or changed ones, are refused."""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from vsacli.base.errors import VsacliError
from vsacli.base.storage import is_folder, owner_of, remove, size_of, staging_name, sweep

LIBRARY = "program.so"
CHECKSUM = "program.sha256"

MOST_BYTES = 100_000_000
"""Largest size of all libraries, in bytes, enough for some hundred robots; least recently used go first."""


class CacheError(VsacliError):
    """The cache folder, or something in it, cannot be used; the message says why."""


class Entry(NamedTuple):
    """A stored library: time of its last use, s since 1970, size in bytes, and key."""

    used: float
    size: int
    key: str


@dataclass(frozen=True)
class Cache:
    """Libraries in a folder; get it from `open_cache`.

    Several processes may use it at the same time. A library is added and removed by renaming its folder, so
    that it is there completely or not at all; a loaded library stays loaded when another process removes it.
    """

    folder: Path

    def find(self, key: str) -> Path | None:
        """Return the library of a key, if there is one.

        Raises:
            CacheError: Its content has changed; it is removed.
        """
        library = self.folder / key / LIBRARY
        if not library.parent.exists():
            return None
        with suppress(OSError):
            if (self.folder / key / CHECKSUM).read_text(encoding="ascii", errors="replace") == _checksum(
                library
            ):
                os.utime(library.parent)
                return library
        if not library.parent.exists():
            return None  # another process has removed it meanwhile
        self._remove(key)
        raise CacheError(f"{library} was damaged; it is removed")

    def store(self, key: str, library: Path) -> None:
        """Copy a library to its place, completely or not at all; the first of two processes wins.

        The least recently used libraries are removed to make room for it.

        Raises:
            CacheError: There is no room or no permission.
        """
        try:
            with self._staging_folder() as folder:
                entry = folder / key
                entry.mkdir(parents=True)
                shutil.copyfile(library, entry / LIBRARY)
                (entry / CHECKSUM).write_text(_checksum(library), encoding="ascii")
                _move_folder(entry, self.folder / key)
            self._make_room(key)
        except OSError as error:
            raise CacheError(f"the cache folder {self.folder} cannot be written: {error.strerror}") from None

    def entries(self) -> list[Entry]:
        """Return all libraries, the least recently used first; other folders are ignored."""
        libraries = []
        for path in self.folder.iterdir():
            with suppress(FileNotFoundError):  # removed meanwhile
                if is_folder(path) and owner_of(path.name) is None and _holds_a_library(path):
                    libraries.append(Entry(path.stat().st_mtime, size_of(path), path.name))
        return sorted(libraries)

    def clear(self) -> None:
        """Remove all libraries.

        Raises:
            CacheError: No permission.
        """
        sweep(self.folder)
        for entry in self.entries():
            self._remove(entry.key)

    def _make_room(self, new_key: str) -> None:
        """Remove the least recently used libraries until all are within `MOST_BYTES`; keep the new one."""
        entries = self.entries()
        excess = sum(entry.size for entry in entries) - MOST_BYTES
        for entry in entries:
            if excess > 0 and entry.key != new_key:
                self._remove(entry.key)
                excess -= entry.size

    def _remove(self, key: str) -> None:
        """Remove a folder: rename it first, so that it vanishes for other processes at once.

        Raises:
            CacheError: No permission.
        """
        try:
            with self._staging_folder() as folder:
                (self.folder / key).rename(folder)
        except FileNotFoundError:  # another process has removed it
            pass
        except OSError as error:
            raise CacheError(f"{self.folder / key} cannot be removed: {error.strerror}") from None

    @contextmanager
    def _staging_folder(self) -> Iterator[Path]:
        """Yield a folder name of this process; remove it at the end, and those of killed processes."""
        sweep(self.folder)
        staging_folder = self.folder / staging_name()
        try:
            yield staging_folder
        finally:
            remove(staging_folder)


def open_cache() -> Cache:
    """Return the cache of the user; create it if necessary.

    Raises:
        CacheError: The folder cannot be created, is not the user's, or is writable by others.
    """
    try:
        folder = _cache_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
    except (OSError, RuntimeError) as error:  # RuntimeError: the user has no home
        raise CacheError(f"there is no cache folder: {error}") from None
    if hasattr(os, "getuid") and status.st_uid != os.getuid():
        raise CacheError(f"the cache folder {folder} belongs to somebody else")
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise CacheError(
            f"the cache folder {folder} can be written by others; `chmod go-w {folder}` fixes that"
        )
    return Cache(folder)


def _cache_folder() -> Path:
    """Return the folder of the XDG base directory specification, which ignores relative paths."""
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (base if base.is_absolute() else Path.home() / ".cache") / "vsacli"


def key_of(*parts: str) -> str:
    """Return the key of a library: a digest of everything it depends on."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def _holds_a_library(folder: Path) -> bool:
    return {path.name for path in folder.iterdir()} <= {LIBRARY, CHECKSUM}


def _checksum(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _move_folder(entry: Path, target: Path) -> None:
    """Rename a folder, unless the target exists: a folder with files in it is not replaced."""
    try:
        entry.rename(target)
    except OSError:
        if not target.exists():
            raise
