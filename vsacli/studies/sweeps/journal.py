"""The journal of finished rows, an append-only file that survives any end of the study.

The first line identifies the file as a journal. Each further line has a checksum of the rest, the key of the
row, and the row. An incomplete last line, after a kill or a full disk, is cut off when the journal is opened
again; damaged lines before it are skipped. A journal appears with its first line, so an empty file is none.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import re
import stat
import time
import zlib
from operator import itemgetter
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import StorageError
from vsacli.base.storage import reason, remove, reporting_storage_errors, staging_name
from vsacli.studies.sweeps.rows import Row

FIRST_LINE = b"vsacli-study-journal/1\n"
"""First line of a journal; a file without it is not overwritten."""

NO_JOURNAL = (
    "is not the journal of a study, but has the name of the file in which this one keeps its finished runs; "
    "move it, or name another table with -o"
)

SYNC_SECONDS = 1.0
"""Interval at which rows are forced to the disk, s: a power failure loses no more, a kill loses nothing."""


class Journal:
    """A context manager that keeps a journal open, and locked if the system can; it removes an empty one.

    Args:
        path: path of the journal, which is created if it does not exist.

    Attributes:
        path: path of the journal.
        damaged: numbers of damaged lines, from 1.

    Raises:
        StorageError: the file cannot be opened, is not a journal, or another process uses it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.damaged: list[int] = []
        self._row_spans: dict[str, tuple[int, int]] = {}

    def __enter__(self) -> Self:
        with reporting_storage_errors(self.path):
            if not os.path.lexists(self.path):
                self._create()
            self._file = self._open()
        try:
            self._lock()
            with reporting_storage_errors(self.path):
                self._index_rows()
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
        if not self._row_spans:
            self.remove()
        os.close(self._file)

    def __contains__(self, key: str) -> bool:
        return key in self._row_spans

    def __len__(self) -> int:
        return len(self._row_spans)

    def _create(self) -> None:
        """Create the journal with its first line."""
        staged_path = self.path.with_name(staging_name())
        file = os.open(staged_path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        try:
            os.write(file, FIRST_LINE)
            try:
                os.link(staged_path, self.path)
            except FileExistsError:
                pass  # another process was first
            except OSError:
                staged_path.rename(self.path)  # a file system without links
        finally:
            os.close(file)
            remove(staged_path)

    def _open(self) -> int:
        """Open the journal.

        Raises:
            StorageError: a link or a device has this name.
        """
        if not stat.S_ISREG(self.path.lstat().st_mode):
            raise StorageError(self.path, NO_JOURNAL)
        return os.open(self.path, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))

    def _lock(self) -> None:
        """Lock the journal, if the system has locks.

        Raises:
            StorageError: another process uses the journal.
        """
        try:
            import fcntl

            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise StorageError(
                self.path, "another process computes this study; wait for it, or end it"
            ) from error
        except (ImportError, OSError):
            pass  # a system or file system without locks

    def _index_rows(self) -> None:
        """Find the rows, and cut off an incomplete last line.

        Raises:
            StorageError: the file is not a journal; it is left unchanged.
        """
        with open(self._file, "rb", closefd=False) as file:
            self._check_first_line(file.readline(len(FIRST_LINE)))
            self._end = len(FIRST_LINE)
            for line_number, line in enumerate(file, 2):
                if not line.endswith(b"\n"):
                    break
                start, key = _find_row(line)
                if key:
                    self._row_spans[key] = (self._end + start, len(line) - start)
                if start or not key:
                    self.damaged.append(line_number)
                self._end += len(line)
        os.ftruncate(self._file, self._end)

    def _check_first_line(self, line: bytes) -> None:
        """Check the first line; write it to a file that has only a part of it after a power failure."""
        if line == FIRST_LINE:
            return
        if not line or not FIRST_LINE.startswith(line):
            raise StorageError(self.path, NO_JOURNAL)
        try:
            os.lseek(self._file, 0, os.SEEK_SET)
            os.write(self._file, FIRST_LINE)
        except OSError:
            self.remove()
            raise

    def add(self, row: Row) -> None:
        """Add a row.

        Raises:
            StorageError: the disk is full or fails; previous rows are kept.
        """
        line = _journal_line(row)
        try:
            os.lseek(self._file, self._end, os.SEEK_SET)
            unwritten = memoryview(line)
            while len(unwritten):
                unwritten = unwritten[os.write(self._file, unwritten) :]
            if time.monotonic() > self._synced + SYNC_SECONDS:
                os.fsync(self._file)
                self._synced = time.monotonic()
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, self._end)
            rows = "row in it stays" if len(self) == 1 else f"{len(self):,} rows in it stay"
            advice = f"the {rows}, and the same command goes on from there"
            raise StorageError(self.path, f"cannot be written: {reason(error)}; {advice}") from error
        self._row_spans[row.key] = (self._end, len(line))
        self._end += len(line)

    def row(self, run: int, key: str) -> Row:
        """Return the row of a run.

        Raises:
            KeyError: the journal does not have it.
        """
        start, byte_count = self._row_spans[key]
        os.lseek(self._file, start, os.SEEK_SET)
        content = json.loads(os.read(self._file, byte_count)[CHECKSUM_DIGITS + 1 :])
        texts, arrays = itemgetter(*_TEXTS)(content), itemgetter(*_ARRAYS)(content)
        return Row(run, key, *texts, *map(_decode_array, arrays))

    def remove(self) -> None:
        """Remove the file."""
        with contextlib.suppress(OSError):
            self.path.unlink(missing_ok=True)


_TEXTS = ("verdict", "first_limit", "error")

_ARRAYS = ("values", "curves")

CHECKSUM_DIGITS = 8
"""Number of hexadecimal digits of a checksum."""


_ROW_START = re.compile(rb'[0-9a-f]{8} \{"key": ')


def _journal_line(row: Row) -> bytes:
    arrays = {name: base64.b64encode(getattr(row, name).tobytes()).decode() for name in _ARRAYS}
    content = {"key": row.key, **{name: getattr(row, name) for name in _TEXTS}, **arrays}
    content_bytes = json.dumps(content).encode()
    return b"%08x %s\n" % (zlib.crc32(content_bytes), content_bytes)


def _find_row(line: bytes) -> tuple[int, str]:
    """Return the start of the row at the end of a line, and its key; "" if the line has no valid row."""
    # if the line break before a row is damaged, the row is intact but does not start its line
    for start in (0, *(found.start() for found in _ROW_START.finditer(line, 1))):
        content_bytes = line[start + CHECKSUM_DIGITS + 1 : -1]
        if line[start : start + CHECKSUM_DIGITS] == b"%08x" % zlib.crc32(content_bytes) and (
            key := _key_of_row(content_bytes)
        ):
            return start, key
    return 0, ""


def _key_of_row(content_bytes: bytes) -> str:
    """Return the key of a row; "" for text that is none although its checksum is right."""
    try:
        content = json.loads(content_bytes)
        key, *texts = itemgetter("key", *_TEXTS)(content)
        for name in _ARRAYS:
            _decode_array(content[name])
    except (ValueError, LookupError, TypeError, RecursionError):
        return ""
    return key if all(isinstance(each, str) for each in (key, *texts)) else ""


def _decode_array(text: str) -> FloatArray:
    return np.frombuffer(base64.b64decode(text, validate=True))
