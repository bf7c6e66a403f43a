"""Compiled code that is kept, and what is not finished elsewhere, as JSON values."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from vsacli.base.errors import StorageError
from vsacli.base.staging import unfinished
from vsacli.compute.engine.cache import MOST_BYTES, Cache, CacheError, open_cache


def describe_cache(folder: str) -> dict[str, Any]:
    """The cache of compiled code, and unfinished files in a folder and in that for temporary files.

    Raises:
        StorageError: the cache cannot be used.
    """
    with _opened() as cache:
        sizes = [entry.size for entry in cache.entries()]
        found = [each for place in _places(Path(folder), cache.folder) for each in unfinished(place)]
    return {
        "kind": "cache",
        "folder": str(cache.folder),
        "entries": len(sizes),
        "size": sum(sizes),
        "limit": MOST_BYTES,
        "unfinished": [
            {"path": str(each.path), "size": each.size, "owner": each.owner.value} for each in found
        ],
    }


def clear_cache() -> None:
    """Remove all compiled code.

    Raises:
        StorageError: the cache cannot be used.
    """
    with _opened() as cache:
        cache.clear()


@contextmanager
def _opened() -> Iterator[Cache]:
    try:
        yield open_cache()
    except CacheError as error:
        raise StorageError("compiled code", str(error)) from error


def _places(*folders: Path) -> list[Path]:
    """These folders, and that for temporary files if there is one, each once."""
    places = dict.fromkeys(folders)
    with suppress(OSError):
        places[Path(tempfile.gettempdir())] = None
    return list(places)
