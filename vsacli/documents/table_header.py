"""The header of a CSV table: what separates its columns, and what they are called."""

from __future__ import annotations

import csv
import math
import os
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from io import TextIOWrapper
from typing import BinaryIO, NamedTuple

from vsacli.base.errors import InputError, Problem
from vsacli.base.streams import place_of
from vsacli.documents.source import check_input_file

MAX_BYTES = 10_000_000_000
MAX_HEADER = 100_000
"""Characters in the header line, or in one before it; binary data often has none or a longer one."""
SEPARATORS = ("\t", ";", ",")
"""In the order in which they are looked for in the header line, outside quotes."""
COMMENT = "#"
QUOTE = '"'
NOT_UTF8 = "\ufffd"
"""What bytes that are not UTF-8 are read as."""
_HEADING = re.compile(r"(?P<name>[^\[\]]*?)\s*(\[(?P<unit>[^\[\]]*)\])?")
_INDEX = re.compile(r"\d+")
"""In brackets an index, as in `position[2]`, and no unit."""
_QUOTED = re.compile(r'"[^"]*"')


class Header(NamedTuple):
    """The header of a table.

    Attributes:
        line: its line, from 1; 0 if the table has none and the first line is a row.
        separator: what stands between the cells of a line.
        columns: names of the columns as written, without quotes; empty texts if there is no header.
    """

    line: int
    separator: str
    columns: tuple[str, ...]


def split_heading(text: str) -> tuple[str, str | None]:
    """Name of a column, and the unit in brackets that follows it, if one does."""
    match = _HEADING.fullmatch(text)
    if match is None or _INDEX.fullmatch(match["unit"] or ""):
        return text, None
    return match["name"], match["unit"]


def read_header(path: str | os.PathLike[str], numbered: Sequence[int] = ()) -> Header:
    """The header of a CSV file, whatever its columns are called; `numbered` as of `header_of`.

    Raises:
        InputError: the file cannot be read, or does not begin as a table does.
    """
    name = os.fspath(path)
    check_input_file(name, MAX_BYTES)
    try:
        with open(place_of(name), "rb") as content:
            return header_of(content, name, strict=False, numbered=numbered)
    except OSError as error:
        raise InputError.one(f"cannot be read: {error.strerror or error}", name) from None


def header_of(content: BinaryIO, name: str, *, strict: bool = True, numbered: Sequence[int] = ()) -> Header:
    """The header of a table.

    Args:
        content: the file, read from its beginning.
        name: its path, for messages.
        strict: whether each column must have a name of its own.
        numbered: numbers of columns, from 1, that need no name: if all hold numbers, the line is a row.

    Raises:
        InputError: with everything that is wrong with the line.
    """
    file = TextIOWrapper(content, encoding="utf-8-sig", errors="replace")
    number, line, comment = 0, "\n", 0
    while (line == "\n" or line.startswith(COMMENT)) and len(line) < MAX_HEADER:
        comment = number if line != "\n" else comment
        number, line = number + 1, file.readline(MAX_HEADER)
    file.detach()
    text = line.partition(COMMENT)[0]
    bare = _QUOTED.sub("", text)
    separator = next((mark for mark in SEPARATORS if mark in bare), SEPARATORS[-1])
    columns = tuple(cell.strip() for cell in cells_of(text.rstrip("\r\n"), separator))
    numbers = [is_number(cell.replace(",", "," if separator == "," else ".")) for cell in columns]
    if numbered and all(numbers[place - 1] for place in numbered if place <= len(columns)):
        return Header(0, separator, ("",) * len(columns))
    number = number if line else 1
    problems = [Problem(name, number, message) for message in _problems(line, columns, comment, strict)]
    if problems:
        raise InputError(problems)
    return Header(number, separator, columns)


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes."""
    return next(csv.reader([line], delimiter=separator), [""]) if QUOTE in line else line.split(separator)


def is_number(cell: str) -> bool:
    """Whether a cell holds a finite number in ASCII."""
    try:
        return math.isfinite(float(cell)) and cell.isascii() and "_" not in cell
    except ValueError:
        return False


def _problems(line: str, columns: tuple[str, ...], comment: int, strict: bool) -> Iterator[str]:
    if not line.strip():
        yield "expected a header line with the names of the columns, found nothing"
    elif NOT_UTF8 in line or "\0" in line:
        yield "expected a header line in UTF-8, found other bytes"
    elif len(line) == MAX_HEADER:
        yield f"expected a header line, found more than {MAX_HEADER} characters without a line break"
    elif all(is_number(column) for column in columns):
        yield f"expected a header line with the names of the columns, found numbers{_remedy(comment)}"
    elif len(columns) == 1 and len(line.partition("[")[0].split()) > 1:
        yield "expected commas, semicolons or tabs between the columns, found blanks"
    elif strict:
        yield from (f"column {i} has no name" for i, column in enumerate(columns, 1) if not column)
        repeated = Counter(column for column in columns if column)
        yield from (f"column {column!r} appears {n} times" for column, n in repeated.items() if n > 1)


def _remedy(comment: int) -> str:
    if comment:
        return f"; if line {comment} is meant, remove its {COMMENT!r}"
    return "; without one, columns are given by their numbers, as in columns: {time: 1, elbow.q: 2}"
