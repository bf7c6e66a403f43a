"""Description of the cache of compiled code, and of unfinished files."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from vsacli.base.errors import StorageError
from vsacli.base.storage import unfinished
from vsacli.base.texts import counted
from vsacli.compute.engine.cache import MOST_BYTES, Cache, CacheError, open_cache


def describe_cache(folder: str) -> dict[str, Any]:
    """Describe the cache of compiled code, and unfinished files in a folder and in that for temporary files.

    Raises:
        StorageError: the cache cannot be used.
    """
    with _open_cache() as cache:
        sizes = [entry.size for entry in cache.entries()]
        unfinished_files = [
            each for place in _folders_once(Path(folder), cache.folder) for each in unfinished(place)
        ]
    return {
        "kind": "cache",
        "folder": str(cache.folder),
        "entries": len(sizes),
        "size": sum(sizes),
        "limit": MOST_BYTES,
        "unfinished": [
            {"path": str(each.path), "size": each.size, "owner": each.owner.value}
            for each in unfinished_files
        ],
    }


def clear_cache() -> None:
    """Remove all compiled code.

    Raises:
        StorageError: the cache cannot be used.
    """
    with _open_cache() as cache:
        cache.clear()


@contextmanager
def _open_cache() -> Iterator[Cache]:
    try:
        yield open_cache()
    except CacheError as error:
        raise StorageError("compiled code", str(error)) from error


def _folders_once(*folders: Path) -> list[Path]:
    """Return these folders and the folder for temporary files, if there is one, each once."""
    places = dict.fromkeys(folders)
    with suppress(OSError):
        places[Path(tempfile.gettempdir())] = None
    return list(places)


_OWNERS = {
    "ended": "of a process that has ended: the next command that writes there removes it",
    "running": "of a process that is running",
    "elsewhere": "of another host or container: remove it if nothing runs there any more",
}


def cache_lines(cache: Mapping[str, Any]) -> Iterator[str]:
    """Yield the description of the cache as lines of text."""
    libraries = counted(cache["entries"], "library", "libraries")
    size, limit = _megabytes(cache["size"]), _megabytes(cache["limit"])
    yield f"compiled code: {libraries}, {size} of at most {limit}, in {cache['folder']}"
    for file in cache["unfinished"]:
        yield f"unfinished: {file['path']}, {_megabytes(file['size'])}, {_OWNERS[file['owner']]}"


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.3g} MB"
