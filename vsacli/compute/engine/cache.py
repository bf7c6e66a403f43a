"""Compiled libraries in the user's cache folder: nobody else's, whole, unchanged since they were built."""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from vsacli.base.errors import VsacliError

LIBRARY = "program.so"
CHECKSUM = "program.sha256"
UNFINISHED = "unfinished-"
ABANDONED_AFTER = 3600.0
"""Age in seconds from which on an unfinished folder is that of a process that was killed."""


class CacheError(VsacliError):
    """The cache folder, or something in it, cannot be used; the message says why."""


@dataclass(frozen=True)
class Cache:
    """Libraries in a folder; get it from `open_cache`."""

    folder: Path

    def find(self, key: str) -> Path | None:
        """The library of a key, if there is one.

        Raises:
            CacheError: there is, but it is not what was stored; it is removed.
        """
        library = self.folder / key / LIBRARY
        if not library.parent.exists():
            return None
        with suppress(OSError):
            if (self.folder / key / CHECKSUM).read_text(encoding="ascii", errors="replace") == _checksum(
                library
            ):
                return library
        self._remove(key)
        raise CacheError(f"{library} was damaged; it is removed")

    def store(self, key: str, library: Path) -> None:
        """Copy a library to its place, whole or not at all; of two processes at it, the first one's stays.

        Raises:
            CacheError: there is no room or no permission.
        """
        try:
            self._sweep()
            with TemporaryDirectory(prefix=UNFINISHED, dir=self.folder, ignore_cleanup_errors=True) as folder:
                entry = Path(folder) / key
                entry.mkdir()
                shutil.copyfile(library, entry / LIBRARY)
                (entry / CHECKSUM).write_text(_checksum(library), encoding="ascii")
                _move(entry, self.folder / key)
        except OSError as error:
            raise CacheError(f"the cache folder {self.folder} cannot be written: {error.strerror}") from None

    def _remove(self, key: str) -> None:
        """Out of the way of others at once, then for good.

        Raises:
            CacheError: no permission.
        """
        try:
            with TemporaryDirectory(prefix=UNFINISHED, dir=self.folder) as folder:
                (self.folder / key).rename(Path(folder) / key)
        except FileNotFoundError:  # somebody else was faster
            pass
        except OSError as error:
            raise CacheError(
                f"{self.folder / key} is damaged and cannot be removed: {error.strerror}"
            ) from None

    def _sweep(self) -> None:
        """Remove what killed processes left."""
        for folder in self.folder.glob(f"{UNFINISHED}*"):
            with suppress(OSError):
                if folder.stat().st_mtime < time.time() - ABANDONED_AFTER:
                    shutil.rmtree(folder)


def open_cache() -> Cache:
    """The cache of the user, made if need be.

    Raises:
        CacheError: it cannot be made, is not the user's, or others may write to it.
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
            f"the cache folder {folder} can be written by others; `chmod go-w {folder}` mends that"
        )
    return Cache(folder)


def _cache_folder() -> Path:
    """That of the XDG base directory specification, where a relative path does not count."""
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (base if base.is_absolute() else Path.home() / ".cache") / "vsacli"


def key_of(*parts: str) -> str:
    """What a library is stored under: a digest of all that it depends on."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def _checksum(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _move(entry: Path, target: Path) -> None:
    """Rename a folder, unless the target is there: a folder with files in it is not replaced."""
    try:
        entry.rename(target)
    except OSError:
        if not target.exists():
            raise
