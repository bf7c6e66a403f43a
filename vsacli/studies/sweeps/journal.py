"""Rows that are finished, in a file that is only ever added to: whatever ends the study, they stay.

A line holds the checksum of what follows, the key of the row, and the row. What a kill or a full disk left
of a line is cut off when the journal is opened again.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import time
import zlib
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from vsacli.base.errors import StorageError
from vsacli.base.storage import reason, reporting_storage_errors
from vsacli.studies.sweeps.rows import Row

SYNC_SECONDS = 1.0
"""How often rows are forced to the disk: what a power failure may cost; a kill costs none."""


class Journal:
    """Context manager that holds a journal open, and locked where the system can; an empty one is removed.

    Args:
        path: of the journal; it is made if it does not exist.

    Raises:
        StorageError: it cannot be opened, or another process works with it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._places: dict[str, tuple[int, int]] = {}

    def __enter__(self) -> Self:
        with reporting_storage_errors(self.path):
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            self._lock()
            with reporting_storage_errors(self.path):
                self._index()
        except BaseException:
            os.close(self._file)
            raise
        self._synced = time.monotonic()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        with contextlib.suppress(OSError):
            os.fsync(self._file)
        if not self._places:
            self.remove()
        os.close(self._file)

    def __contains__(self, key: str) -> bool:
        return key in self._places

    def __len__(self) -> int:
        return len(self._places)

    def _lock(self) -> None:
        """Refuse a journal that another process works with, where the system has locks."""
        try:
            import fcntl

            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise StorageError(
                self.path, "another process computes this study; wait for it, or end it"
            ) from error
        except (ImportError, OSError):
            pass  # a system or file system without locks

    def _index(self) -> None:
        """Find the rows; what begins with the first line that is not whole is cut off."""
        self._end = 0
        with open(self._file, "rb", closefd=False) as file:
            for line in file:
                key = _key(line)
                if key is None:
                    break
                self._places[key] = (self._end, len(line))
                self._end += len(line)
        os.ftruncate(self._file, self._end)

    def add(self, row: Row) -> None:
        """Add a row.

        Raises:
            StorageError: the disk is full or fails; the rows before stay.
        """
        line = _line(row)
        try:
            os.lseek(self._file, self._end, os.SEEK_SET)
            rest = memoryview(line)
            while len(rest):
                rest = rest[os.write(self._file, rest) :]
            if time.monotonic() > self._synced + SYNC_SECONDS:
                os.fsync(self._file)
                self._synced = time.monotonic()
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, self._end)
            kept = f"the {len(self):,} rows in it stay, and the same command goes on with them"
            raise StorageError(self.path, f"cannot be written: {reason(error)}; {kept}") from error
        self._places[row.key] = (self._end, len(line))
        self._end += len(line)

    def row(self, run: int, key: str) -> Row:
        """The row of a run that is there.

        Raises:
            KeyError: it is not.
        """
        start, size = self._places[key]
        os.lseek(self._file, start, os.SEEK_SET)
        content = json.loads(os.read(self._file, size)[_CHECK + 1 :])
        values, curves = (np.frombuffer(base64.b64decode(content[name])) for name in _ARRAYS)
        return Row(run, key, content["verdict"], content["error"], values, curves)

    def remove(self) -> None:
        """Remove the file, whose rows are kept elsewhere."""
        with contextlib.suppress(OSError):
            self.path.unlink(missing_ok=True)


_ARRAYS = ("values", "curves")

_CHECK = 8
"""Hexadecimal digits of a checksum."""


def _line(row: Row) -> bytes:
    arrays = {name: base64.b64encode(getattr(row, name).tobytes()).decode() for name in _ARRAYS}
    content = {"key": row.key, "verdict": row.verdict, "error": row.error, **arrays}
    text = json.dumps(content).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _key(line: bytes) -> str | None:
    """The key of the row in a line; None if the line is not whole."""
    text = line[_CHECK + 1 : -1]
    if not line.endswith(b"\n") or line[:_CHECK] != b"%08x" % zlib.crc32(text):
        return None
    return str(json.loads(text)["key"])
