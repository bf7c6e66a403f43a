"""Strict reading of CSV tables: a header line, then numbers. Knows columns, not robots."""

from __future__ import annotations

import hashlib
import math
import os
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from io import BufferedReader, TextIOWrapper
from itertools import islice

import numpy as np

from vsacli.arrays import FloatArray
from vsacli.errors import InputError, Problem
from vsacli.spec.source import MAX_DOCUMENT_BYTES, Source, check_input_file, decode_utf8

MAX_BYTES = 10_000_000_000
MAX_HEADER = 100_000
"""Characters in the header line; binary data often has none or a longer one."""
MAX_PROBLEMS = 10
"""A file with more problems is given up on."""
NOT_UTF8 = "\ufffd"
"""What bytes that are not UTF-8 are read as."""


@dataclass(frozen=True, eq=False)
class Table:
    """A table as it was read.

    Attributes:
        columns: names from the header line.
        values: (rows, columns), all finite, at least one row.
        source: the file.
    """

    columns: tuple[str, ...]
    values: FloatArray = field(repr=False)
    source: Source


def line_of(row: int) -> int:
    """Line in the file of a row counted from 0; the header is line 1, and no line between rows is empty."""
    return row + 2


def read_table(path: str | os.PathLike[str]) -> Table:
    """Read a CSV file.

    Args:
        path: the file; UTF-8, a byte order mark is accepted. Empty lines are accepted at the end only.

    Raises:
        InputError: with file and line of what is no such table.
    """
    name = os.fspath(path)
    check_input_file(name, MAX_BYTES)
    try:
        with open(name, "rb") as content:
            file = TextIOWrapper(content, encoding="utf-8-sig", errors="replace")
            columns = _read_header(file, name)
            values = _read_rows(file, columns, name)
            return Table(columns, values, _source(content, name))
    except OSError as error:
        raise InputError.one(f"cannot be read: {error.strerror}", name) from None


def _read_header(file: TextIOWrapper, name: str) -> tuple[str, ...]:
    line = file.readline(MAX_HEADER)
    columns = tuple(cell.strip() for cell in line.split(","))
    problems = [Problem(name, 1, message) for message in _header_problems(line, columns)]
    if problems:
        raise InputError(problems)
    return columns


def _header_problems(line: str, columns: tuple[str, ...]) -> Iterator[str]:
    if not line.strip():
        yield "expected a header line with the names of the columns, found nothing"
    elif NOT_UTF8 in line:
        yield "expected a header line in UTF-8, found other bytes"
    elif len(line) == MAX_HEADER:
        yield f"expected a header line, found more than {MAX_HEADER} characters without a line break"
    elif all(_is_number(column) for column in columns):
        yield "expected a header line with the names of the columns, found numbers"
    elif len(columns) == 1 and (separator := next((mark for mark in ";\t" if mark in line), None)):
        yield f"expected commas between the columns, found {separator!r}"
    else:
        yield from (f"column {i} has no name" for i, column in enumerate(columns, 1) if not column)
        repeated = Counter(column for column in columns if column)
        yield from (f"column {column!r} appears {n} times" for column, n in repeated.items() if n > 1)


class _Rows:
    """The lines below the header, noting on the way the number of the last one that is not empty."""

    def __init__(self, file: TextIOWrapper) -> None:
        self._file = file
        self.last = 0

    def __iter__(self) -> Iterator[str]:
        for number, line in enumerate(self._file, 1):
            if line != "\n":
                self.last = number
            yield line


def _read_rows(file: TextIOWrapper, columns: tuple[str, ...], name: str) -> FloatArray:
    """NumPy's C reader; only if it fails, or has met anything unusual, each line is looked at."""
    lines = _Rows(file)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # NumPy's way to say that there are no rows
        try:
            values = np.loadtxt(lines, delimiter=",", comments=None, encoding=None, ndmin=2)
        except (ValueError, UserWarning):
            values = np.empty((0, len(columns)))
    if values.shape != (lines.last, len(columns)) or not np.isfinite(values).all():
        _refuse_rows(file, columns, name)
    if not len(values):
        raise InputError.one("there are no rows below the header", name)
    return values


def _refuse_rows(file: TextIOWrapper, columns: tuple[str, ...], name: str) -> None:
    """Raise the first problems of the rows, if there are any."""
    file.seek(0)
    next(file)
    problems = _row_problems(file, columns, name)
    shown = list(islice(problems, MAX_PROBLEMS))
    if next(problems, None):
        shown.append(Problem(name, 0, f"more than {MAX_PROBLEMS} problems; reading stopped there"))
    if shown:
        raise InputError(shown)


def _row_problems(lines: Iterable[str], columns: tuple[str, ...], name: str) -> Iterator[Problem]:
    empty: list[int] = []
    for number, line in enumerate(lines, line_of(0)):
        if line == "\n":
            empty.append(number)
            continue
        yield from (Problem(name, gap, "the line is empty") for gap in empty)
        empty.clear()
        yield from (Problem(name, number, message) for message in _cell_problems(line, columns))


def _cell_problems(line: str, columns: tuple[str, ...]) -> Iterator[str]:
    count = line.count(",") + 1
    if count != len(columns):
        yield f"expected {len(columns)} values as in the header, found {count}"
        return
    for column, cell in zip(columns, line.split(","), strict=True):
        if not _is_number(cell):
            yield f"column {column!r}: expected a finite number, found {cell.strip()[:40]!r}"


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell)) and cell.isascii() and "_" not in cell
    except ValueError:
        return False


def _source(content: BufferedReader, name: str) -> Source:
    content.seek(0)
    digest = hashlib.file_digest(content, "sha256").hexdigest()
    content.seek(0)
    text = content.read(MAX_DOCUMENT_BYTES + 1)
    return Source(name, digest, decode_utf8(text, name) if len(text) <= MAX_DOCUMENT_BYTES else None)
