"""Strict reading of CSV tables: a header line, then numbers. Knows columns, not robots."""

from __future__ import annotations

import hashlib
import math
import os
import re
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from io import TextIOWrapper
from typing import BinaryIO, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.base.errors import InputError, Problem
from vsacli.base.streams import place_of
from vsacli.documents.source import MAX_DOCUMENT_BYTES, Source, check_input_file, decode_utf8

MAX_BYTES = 10_000_000_000
MAX_HEADER = 100_000
"""Characters in the header line, or in one before it; binary data often has none or a longer one."""
CHUNK = 1_000_000
"""Bytes read at a time; a longer line is none of a table."""
SEPARATORS = ("\t", ";", ",")
"""In the order in which they are looked for in the header line."""
COMMENT = "#"
MAX_KINDS = 10
"""Kinds of problems that are told."""
MAX_ALIKE = 1000
"""Problems of one kind after which reading is given up."""
NOTHING = ("", "nan")
"""What stands in a cell for no number, where that is admitted."""
NOT_UTF8 = "\ufffd"
"""What bytes that are not UTF-8 are read as."""
_HEADING = re.compile(r"(?P<name>[^\[\]]*?)\s*(\[(?P<unit>[^\[\]]*)\])?")
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+,\d+(e[+-]?\d+)?\s*", re.IGNORECASE)


def split_heading(text: str) -> tuple[str, str | None]:
    """Name of a column, and the unit in brackets that follows it, if one does."""
    match = _HEADING.fullmatch(text)
    return (text, None) if match is None else (match["name"], match["unit"])


@dataclass(frozen=True, eq=False)
class Table:
    """A table as it was read.

    Attributes:
        columns: names from the header line.
        values: (rows, columns), all finite, at least one row; NaN in empty cells if these are admitted.
        source: the file.
        header_line: line of the header in the file, from 1.
    """

    columns: tuple[str, ...]
    values: FloatArray = field(repr=False)
    source: Source
    header_line: int = 1

    @cached_property
    def lines(self) -> Lines:
        """The lines of the file in which the rows stand."""
        return Lines(self.source.path, self.header_line)

    def line_of(self, row: int) -> int:
        """Line in the file of a row counted from 0; 0 if the file has gone."""
        return self.lines.of(row)


@dataclass(frozen=True, eq=False)
class Lines:
    """The lines of a file in which the rows of its table stand, found by reading it once more.

    Attributes:
        path: of the file.
        header_line: line of the header, from 1.
    """

    path: str
    header_line: int

    def of(self, row: int) -> int:
        """Line of a row counted from 0; 0 if the file has gone."""
        return int(self._numbers[row]) if row < len(self._numbers) else 0

    @cached_property
    def _numbers(self) -> IndexArray:
        try:
            with open(place_of(self.path), encoding="utf-8-sig", errors="replace") as file:
                numbers = [number for number, _ in _rows(file, self.header_line)]
        except OSError:
            numbers = []
        return np.array(numbers, dtype=np.intp)


class _Header(NamedTuple):
    line: int
    separator: str
    columns: tuple[str, ...]


def read_table(path: str | os.PathLike[str], *, empty_cells: bool = False) -> Table:
    """Read a CSV file, in about the time and memory that `numpy.loadtxt` takes.

    The first line names the columns; a tab, semicolon or comma in it is the separator. From `#` to the end of
    a line is a comment. Lines without anything else are passed over, before the header too.

    Args:
        path: the file; UTF-8, a byte order mark is accepted.
        empty_cells: whether cells may be empty, or hold `nan`, where a column has no sample.

    Raises:
        InputError: with file and line of what is no such table.
    """
    name = os.fspath(path)
    check_input_file(name, MAX_BYTES)
    try:
        with open(place_of(name), "rb") as content:
            header = _read_header(content, name)
            digest, text = _survey(content, name)
        values = _read_rows(header, name, empty_cells)
        source = Source(name, digest, None if text is None else decode_utf8(text, name))
        return Table(header.columns, values, source, header.line)
    except OSError as error:
        raise InputError.one(f"cannot be read: {error.strerror or error}", name) from None


def _read_header(content: BinaryIO, name: str) -> _Header:
    file = TextIOWrapper(content, encoding="utf-8-sig", errors="replace")
    number, line, comment = 0, "\n", 0
    while (line == "\n" or line.startswith(COMMENT)) and len(line) < MAX_HEADER:
        comment = number if line != "\n" else comment
        number, line = number + 1, file.readline(MAX_HEADER)
    file.detach()
    number = number if line else 1
    text = line.partition(COMMENT)[0]
    separator = next((mark for mark in SEPARATORS if mark in text), SEPARATORS[-1])
    columns = tuple(cell.strip() for cell in text.split(separator))
    problems = [Problem(name, number, message) for message in _header_problems(line, columns, comment)]
    if problems:
        raise InputError(problems)
    return _Header(number, separator, columns)


def _header_problems(line: str, columns: tuple[str, ...], comment: int) -> Iterator[str]:
    if not line.strip():
        yield "expected a header line with the names of the columns, found nothing"
    elif NOT_UTF8 in line or "\0" in line:
        yield "expected a header line in UTF-8, found other bytes"
    elif len(line) == MAX_HEADER:
        yield f"expected a header line, found more than {MAX_HEADER} characters without a line break"
    elif all(_is_number(column) for column in columns):
        hint = f"; if line {comment} is meant, remove its {COMMENT!r}" if comment else ""
        yield f"expected a header line with the names of the columns, found numbers{hint}"
    elif len(columns) == 1 and len(line.partition("[")[0].split()) > 1:
        yield "expected commas, semicolons or tabs between the columns, found blanks"
    else:
        yield from (f"column {i} has no name" for i, column in enumerate(columns, 1) if not column)
        repeated = Counter(column for column in columns if column)
        yield from (f"column {column!r} appears {n} times" for column, n in repeated.items() if n > 1)


def _survey(content: BinaryIO, name: str) -> tuple[str, bytes | None]:
    """SHA-256 of a file whose lines have a reasonable length, and its content if that is to be kept."""
    content.seek(0)
    digest, line, text = hashlib.sha256(), 1, b""
    while chunk := content.read(CHUNK):
        if b"\0" in chunk:
            line += chunk.count(b"\n", 0, chunk.index(b"\0"))
            raise InputError.one("holds NUL characters, which no table of numbers has", name, line)
        breaks = chunk.count(b"\n")
        if not breaks and len(chunk) == CHUNK and b"\r" not in chunk:
            raise InputError.one(f"the line is longer than {CHUNK:,} characters", name, line)
        digest.update(chunk)
        line += breaks
        if len(text) <= MAX_DOCUMENT_BYTES:
            text += chunk
    return digest.hexdigest(), text if len(text) <= MAX_DOCUMENT_BYTES else None


def _read_rows(header: _Header, name: str, empty_cells: bool) -> FloatArray:
    """NumPy's C reader; only if it fails, or has met anything unusual, each line is looked at."""
    values, reason = _loaded(os.path.abspath(place_of(name)), header, header.line)
    if empty_cells and not values.size:
        with open(place_of(name), encoding="utf-8-sig", errors="replace") as file:
            values, reason = _loaded(_filled(file, header), header, 0)
    odd = np.isinf(values) if empty_cells else ~np.isfinite(values)
    if values.shape[1] == len(header.columns) and not odd.any():
        return values
    raise InputError(
        _row_problems(header, name, empty_cells) or [Problem(name, 0, f"cannot be read: {reason}")]
    )


def _loaded(source: str | Iterable[str], header: _Header, skipped: int) -> tuple[FloatArray, object]:
    """The rows, and why there are none."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # NumPy's way to say that there are no rows
        try:
            values = np.loadtxt(
                source,
                delimiter=header.separator,
                comments=COMMENT,
                encoding="latin-1",  # comments may be anything; numbers are ASCII
                skiprows=skipped,
                ndmin=2,
            )
        except (ValueError, UserWarning) as error:
            return np.empty((0, 0)), error
    return values, "its rows are not those of a table"


def _filled(file: Iterable[str], header: _Header) -> Iterator[str]:
    """Rows whose empty cells say that there is no number."""
    for _, line in _rows(file, header.line):
        yield header.separator.join(cell if cell.strip() else "nan" for cell in line.split(header.separator))


def _row_problems(header: _Header, name: str, empty_cells: bool) -> list[Problem]:
    """The first problem of each kind, saying how many there are like it."""
    alike: dict[str, list[Problem]] = {}
    empty = True
    with open(place_of(name), encoding="utf-8-sig", errors="replace") as file:
        for number, line in _rows(file, header.line):
            empty = False
            for kind, message in _cell_problems(line, header, empty_cells):
                alike.setdefault(kind, []).append(Problem(name, number, message))
            if len(alike) > MAX_KINDS or any(len(found) >= MAX_ALIKE for found in alike.values()):
                break
    if empty:
        return [Problem(name, 0, "there are no rows below the header")]
    problems = [_summary(found) for found in list(alike.values())[:MAX_KINDS]]
    if len(alike) > MAX_KINDS:
        problems.append(Problem(name, 0, f"more than {MAX_KINDS} kinds of problems; reading stopped there"))
    return problems


def _summary(found: list[Problem]) -> Problem:
    first, count = found[0], len(found)
    if count == 1:
        return first
    number = f"{count}" if count < MAX_ALIKE else f"{count} or more"
    return Problem(first.file, first.line, f"{first.message} (the first of {number} such lines)")


def _rows(file: Iterable[str], header_line: int) -> Iterator[tuple[int, str]]:
    """Number and content of each line below the header that has any."""
    for number, line in enumerate(file, 1):
        content = line.rstrip("\n").partition(COMMENT)[0]
        if number > header_line and (content):
            yield number, content


def _cell_problems(line: str, header: _Header, empty_cells: bool) -> Iterator[tuple[str, str]]:
    """Kind and sentence of what is wrong with a row."""
    cells, columns = line.split(header.separator), header.columns
    if len(cells) != len(columns):
        doubled = header.separator == "," and len(cells) == 2 * len(columns)
        hint = "; decimal commas are not understood, write points" if doubled else ""
        yield "count", f"expected {len(columns)} values as in the header, found {len(cells)}{hint}"
        return
    for column, cell in zip(columns, cells, strict=True):
        if not _is_number(cell) and not (empty_cells and cell.strip().lower() in NOTHING):
            hint = (
                "; decimal commas are not understood, write a point" if _DECIMAL_COMMA.fullmatch(cell) else ""
            )
            yield column, f"column {column!r}: expected a finite number, found {cell.strip()[:40]!r}{hint}"


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell)) and cell.isascii() and "_" not in cell
    except ValueError:
        return False
