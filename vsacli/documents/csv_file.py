"""CSV files: the header, and the rows as texts or numbers. Columns are positions here, without a meaning.

A tab, semicolon or comma in the header separates the cells, or blanks if there is none of these. With
separators other than the comma, numbers may have decimal commas. Cells may be in double quotes, and a comment
goes from `#` to the end of a line. NumPy reads the numbers; single lines are parsed only if they are unusual,
and to report problems.
"""

from __future__ import annotations

import csv
import math
import os
import re
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from io import TextIOWrapper
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError, Problem
from vsacli.base.storage import place_of
from vsacli.base.texts import counted
from vsacli.documents.source import check_input_file, recognizing_other_formats

if TYPE_CHECKING:
    import numpy.typing as npt

MAX_BYTES = 10_000_000_000
MAX_HEADER = 100_000
"""Maximum length of the header line and of lines before it; binary data often has no line break or longer
lines."""
SEPARATORS = ("\t", ";", ",")
"""Separators in the order in which the header line is searched for them, outside quotes."""
BLANKS = " "
"""Separator of a file whose header has none of these but several words; any number of blanks separates."""
COMMENT = "#"
QUOTE = '"'
NOT_UTF8 = "\ufffd"
"""Replacement for bytes that are not UTF-8."""
CHUNK = 1_000_000
"""Bytes per read."""
MAX_KINDS = 10
"""Maximum number of kinds of problems to report."""
MAX_SIMILAR = 1000
"""Number of problems of one kind after which reading stops."""
MISSING_WORDS = frozenset(
    ("", *["nan", "+nan", "-nan", "nan(ind)", "-nan(ind)", "na", "n/a", "null", "none"])
)
"""Cells without a number, in lower case, as C compilers, spreadsheets and statistics programs write them."""
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+,\d+(e[+-]?\d+)?\s*", re.IGNORECASE)
_HEADING = re.compile(r"(?P<name>[^\[\]]*?)\s*(\[(?P<unit>[^\[\]]*)\])?")
_INDEX = re.compile(r"\d+")
"""Index in brackets, as in `position[2]`, which is not a unit."""
HEADER = "expected a header line with column names such as time, base.q"
"""Beginning of messages about a header."""

_KEY = re.compile(r"format: +\S")
"""Beginning of a YAML file of this program."""

_QUOTED = re.compile(r'"[^"]*"')
_UNIT = re.compile(r"\[[^\]]*\]")
_BETWEEN_BLANKS = re.compile(r'(?:"[^"]*"|[^\s"\[]+(?:\[[^\]]*\]\S*)*)(?:\s+\[[^\]]*\])?')
"""A cell of a line whose separators are blanks, with its unit in brackets."""


class Header(NamedTuple):
    """The header of a table.

    Attributes:
        line: line number of the header, from 1; 0 if the table has none and the first line is a row.
        separator: character between the cells of a line.
        columns: names of the columns as written, without quotes; empty texts if there is no header.
        skipped: numbers of lines that are neither header nor rows.
    """

    line: int
    separator: str
    columns: tuple[str, ...]
    skipped: frozenset[int] = frozenset()

    @property
    def interrupted(self) -> bool:
        """Whether lines below the header are skipped, so that each line must be parsed."""
        return any(line > self.line for line in self.skipped)


def split_heading(text: str) -> tuple[str, str | None]:
    """Return the name of a column, and the unit in brackets after it, or None."""
    match = _HEADING.fullmatch(text)
    if match is None or _INDEX.fullmatch(match["unit"] or ""):
        return text, None
    return match["name"], match["unit"]


def read_header(
    path: str | os.PathLike[str], numbered_columns: Sequence[int] = (), skipped: Collection[int] = ()
) -> Header:
    """Return the header of a CSV file with any names; see `header_of` for `numbered_columns` and `skipped`.

    Raises:
        InputError: the file cannot be read, or does not begin like a table.
    """
    name = os.fspath(path)
    check_input_file(name, MAX_BYTES)
    try:
        with recognizing_other_formats(name), open(place_of(name), "rb") as content:
            return header_of(content, name, strict=False, numbered_columns=numbered_columns, skipped=skipped)
    except OSError as error:
        raise InputError.one(f"cannot be read: {error.strerror or error}", name) from None


def header_of(
    content: BinaryIO,
    name: str,
    *,
    strict: bool = True,
    numbered_columns: Sequence[int] = (),
    skipped: Collection[int] = (),
) -> Header:
    """Return the header of a table.

    Args:
        content: file content, read from the beginning.
        name: path for messages.
        strict: whether each column must have a unique name.
        numbered_columns: numbers of columns, from 1, that need no name: if all of them hold numbers, the line
            is a row.
        skipped: numbers of lines to leave out.

    Raises:
        InputError: with every problem of the line.
    """
    file = TextIOWrapper(content, encoding="utf-8-sig", errors="replace")
    number, header_line, comment_line = 0, "\n", 0
    while len(header_line) < MAX_HEADER and (
        header_line == "\n" or header_line.startswith(COMMENT) or (header_line and number in skipped)
    ):
        comment_line = number if header_line.startswith(COMMENT) else comment_line
        number, header_line = number + 1, file.readline(MAX_HEADER)
    file.detach()
    text = header_line.partition(COMMENT)[0]
    separator = separator_of(text)
    columns = tuple(cell.strip() for cell in split_cells(text.rstrip("\r\n"), separator))
    is_numeric = [is_number(cell.replace(",", "," if separator == "," else ".")) for cell in columns]
    if numbered_columns and all(
        is_numeric[column_number - 1] for column_number in numbered_columns if column_number <= len(columns)
    ):
        return Header(0, separator, ("",) * len(columns), frozenset(skipped))
    number = number if header_line else 0
    messages = _header_problems(header_line, columns, comment_line, strict)
    problems = [Problem(name, number, message) for message in messages]
    if problems:
        raise InputError(problems)
    return Header(number, separator, columns, frozenset(skipped))


def separator_of(line: str) -> str:
    """Return the separator in a line, preferably the header."""
    unquoted = _QUOTED.sub("_", line)
    blanks = BLANKS if len(_UNIT.sub("", unquoted).split()) > 1 else SEPARATORS[-1]
    return next((separator for separator in SEPARATORS if separator in unquoted), blanks)


def split_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line, without quotes."""
    if separator == BLANKS:
        return [cell.replace(QUOTE, "") for cell in _BETWEEN_BLANKS.findall(line)]
    return next(csv.reader([line], delimiter=separator), [""]) if QUOTE in line else line.split(separator)


def is_number(cell: str) -> bool:
    """Return whether a cell holds a finite number in ASCII."""
    try:
        return math.isfinite(float(cell)) and cell.isascii() and "_" not in cell
    except ValueError:
        return False


def is_missing(cell: str) -> bool:
    """Return whether a cell says that there is no number, as empty ones do."""
    return cell.strip().lower() in MISSING_WORDS


def _header_problems(line: str, columns: tuple[str, ...], comment: int, strict: bool) -> Iterator[str]:
    if not line:
        yield f"is empty; {HEADER}"
    elif not line.strip():
        yield f"{HEADER}, found blanks"
    elif NOT_UTF8 in line or "\0" in line:
        yield f"{HEADER} in UTF-8, found other bytes"
    elif len(line) == MAX_HEADER:
        yield f"{HEADER}, found more than {MAX_HEADER} characters without a line break"
    elif all(is_number(column) for column in columns):
        yield f"{HEADER}, found numbers{_advise_on_numeric_header(comment)}"
    elif _KEY.match(line):
        yield f"{HEADER}, found YAML, {line.strip()[:40]!r}; rename the file to .yaml"
    elif strict:
        yield from (f"column {i} has no name" for i, column in enumerate(columns, 1) if not column)
        repeated = Counter(column for column in columns if column)
        yield from (f"column {column!r} appears {n} times" for column, n in repeated.items() if n > 1)


def _advise_on_numeric_header(comment: int) -> str:
    if comment:
        return f"; if line {comment} is meant, remove its {COMMENT!r}"
    return "; without one, columns are given by their numbers, as in columns: {time: 1, elbow.q: 2}"


class RowsToRead(NamedTuple):
    """The part of a file to read.

    Attributes:
        path: path of the file.
        header: header of the file.
        used: positions of the columns to read, ascending, from 0.
        empty_cells: whether cells of these columns may be empty, or say otherwise that a number is missing.
    """

    path: str
    header: Header
    used: Sequence[int]
    empty_cells: bool

    @property
    def all_used(self) -> bool:
        """Whether no column is left out."""
        return len(self.used) == len(self.header.columns)

    def name(self, index: int) -> str:
        """Return the name of a column in messages."""
        return repr(self.header.columns[index] or index + 1)

    def texts(self) -> Iterator[tuple[int, list[str]]]:
        """Yield line number and cells of each row, without quotes.

        Raises:
            InputError: a row does not have as many cells as the header.
        """
        cell_count = len(self.header.columns)
        for number, line in self.lines():
            cells = split_cells(line, self.header.separator)
            if len(cells) != cell_count:
                raise InputError.one(wrong_count(cell_count, len(cells)), self.path, number)
            yield number, cells

    def lines(self) -> Iterator[tuple[int, str]]:
        """Yield number and content of each line below the header that is not empty."""
        with open(place_of(self.path), encoding="utf-8-sig", errors="replace") as file:
            yield from filled_lines(file, self.header)


def wrong_count(expected: int, count: int) -> str:
    """Return the problem of a row with another number of values than the header."""
    return f"expected {counted(expected, 'value')}, one for each column of the header, found {count}"


def group_column_problems(problems: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Yield each problem once, after the names of all columns that have it.

    Args:
        problems: pairs of column and problem.
    """
    columns: dict[str, list[str]] = {}
    for column, problem in problems:
        columns.setdefault(problem, []).append(column)
    for problem, names in columns.items():
        where = f"column {names[0]!r}" if len(names) == 1 else f"columns {', '.join(names)}"
        yield f"{where}: {problem}"


def filled_lines(file: Iterable[str], header: Header) -> Iterator[tuple[int, str]]:
    """Yield number and content of each line below the header that is neither empty nor skipped."""
    for number, line in enumerate(file, 1):
        content = line.rstrip("\n").partition(COMMENT)[0]
        if number > header.line and content.strip(BLANKS) and number not in header.skipped:
            yield number, content


def read_numbers(rows: RowsToRead) -> FloatArray:
    """Return the numbers of the columns used, (rows, columns).

    NumPy's C reader is used; only if it fails, or meets anything unusual, each line is parsed.

    Raises:
        InputError: a cell is not a number, or a line is not a row of this table; with file and line.
    """
    values, reason = np.empty((0, 0)), None
    if not rows.header.interrupted and (rows.all_used or _is_regular(rows)):
        values, reason = _load_with_numpy(rows, float)
    if not values.size:
        values, reason = _load_with_numpy(rows, float, _normalized_rows(rows))
    is_unusual = np.isinf(values) if rows.empty_cells else ~np.isfinite(values)
    if values.shape[1] == len(rows.used) and not is_unusual.any():
        return values
    raise InputError(_row_problems(rows) or [Problem(rows.path, 0, f"cannot be read: {reason}")])


def read_integers(rows: RowsToRead) -> npt.NDArray[np.int64] | None:
    """Return the columns used as 64-bit integers, (rows, columns); None if they are not whole numbers."""
    integers, _ = _load_with_numpy(rows, np.int64, _normalized_rows(rows))
    return integers if integers.size else None


def _load_with_numpy(
    rows: RowsToRead, dtype: npt.DTypeLike, cleaned: Iterable[str] | None = None
) -> tuple[npt.NDArray[Any], object]:
    """Return the rows of the file, or of cleaned lines, and the reason if there are none."""
    header, used_columns = rows.header, None if rows.all_used else rows.used
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # NumPy only warns if there are no rows, or no whole numbers
        try:
            values = np.loadtxt(
                os.path.abspath(place_of(rows.path)) if cleaned is None else cleaned,
                dtype=dtype,
                delimiter="\t"
                if cleaned is not None
                else None
                if header.separator == BLANKS
                else header.separator,
                comments=COMMENT,
                encoding="latin-1",  # decodes any comment; numbers are ASCII
                skiprows=header.line if cleaned is None else 0,
                usecols=used_columns if cleaned is None else None,
                ndmin=2,
            )
        except (ValueError, Warning, _IrregularError) as error:
            return np.empty((0, 0)), error
    return values, "its rows are not those of a table"


def _is_regular(rows: RowsToRead) -> bool:
    """Return whether each line has as many cells as the header, so that columns can be picked by position.

    NumPy's reader does not count the cells that it skips. Lines with quotes or comments are parsed one by
    one, as are those with blanks for separators.
    """
    expected, separator = len(rows.header.columns) - 1, ord(rows.header.separator)
    if rows.header.separator == BLANKS:
        return False
    remainder = b""
    with open(place_of(rows.path), "rb") as file:
        for _ in range(rows.header.line):
            file.readline()
        while chunk := file.read(CHUNK):
            lines, _, remainder = (remainder + chunk).rpartition(b"\n")
            if not _has_cell_count(lines + b"\n" if lines else b"", expected, separator):
                return False
    return not remainder or _has_cell_count(remainder + b"\n", expected, separator)


def _has_cell_count(lines: bytes, expected: int, separator: int) -> bool:
    if QUOTE.encode() in lines or COMMENT.encode() in lines or b"\r" in lines.replace(b"\r\n", b""):
        return False
    characters = np.frombuffer(lines, dtype=np.uint8)
    line_ends = np.flatnonzero(characters == ord("\n"))
    separator_counts = np.searchsorted(np.flatnonzero(characters == separator), line_ends)
    return bool(np.all(np.diff(separator_counts, prepend=0) == expected))


class _IrregularError(Exception):
    """A row that does not belong to the table."""


def _normalized_rows(rows: RowsToRead) -> Iterator[str]:
    """Yield rows of the cells used, with points for decimal commas, and `nan` in empty cells."""
    header, decimals = rows.header, _Decimals(rows.header.separator)
    for _, line in rows.lines():
        cells = split_cells(line, header.separator)
        if len(cells) != len(header.columns):
            raise _IrregularError(line)
        used_cells = [cells[place].strip() for place in rows.used]  # also tabs, the separator of the result
        if rows.empty_cells:
            used_cells = [
                "nan" if not cell[-1:].isdigit() and is_missing(cell) else cell for cell in used_cells
            ]
        yield "\t".join(map(decimals.with_points, used_cells))


class _Decimals:
    """The decimal sign of a table, the same throughout; a comma only if it is not the separator."""

    def __init__(self, separator: str) -> None:
        self._admits_comma = separator != ","
        self._sign = ""

    def with_points(self, cell: str) -> str:
        """Return a cell with a decimal point."""
        if "," not in cell and "." not in cell:
            return cell
        sign = "," if "," in cell else "."
        if sign != (self._sign or sign) or (sign == "," and not self._admits_comma):
            raise _IrregularError(cell)
        self._sign = sign
        return cell.replace(",", ".")


def _row_problems(rows: RowsToRead) -> list[Problem]:
    """Return the first problem of each kind, with the number of similar problems."""
    problems_by_kind: dict[str, list[Problem]] = {}
    is_empty, decimals = True, _Decimals(rows.header.separator)
    for number, line in rows.lines():
        is_empty = False
        for kind, message in _cell_problems(rows, line, decimals.with_points):
            problems_by_kind.setdefault(kind, []).append(Problem(rows.path, number, message))
        if len(problems_by_kind) > MAX_KINDS or any(
            len(similar) >= MAX_SIMILAR for similar in problems_by_kind.values()
        ):
            break
    if is_empty:
        return [Problem(rows.path, 0, "has a header but no rows of values")]
    problems = [_first_with_count(similar) for similar in list(problems_by_kind.values())[:MAX_KINDS]]
    if len(problems_by_kind) > MAX_KINDS:
        problems.append(
            Problem(rows.path, 0, f"more than {MAX_KINDS} kinds of problems; reading stopped there")
        )
    return problems


def _first_with_count(similar: list[Problem]) -> Problem:
    first, count = similar[0], len(similar)
    if count == 1:
        return first
    number = f"{count}" if count < MAX_SIMILAR else f"{count} or more"
    return Problem(first.file, first.line, f"{first.message} (the first of {number} such lines)")


def _cell_problems(
    rows: RowsToRead, line: str, with_point: Callable[[str], str]
) -> Iterator[tuple[str, str]]:
    """Yield kind and message of each problem of a row."""
    separator, cell_count = rows.header.separator, len(rows.header.columns)
    cells = split_cells(line, separator)
    if len(cells) != cell_count:
        is_doubled = separator == "," and len(cells) == 2 * cell_count
        hint = "; with decimal commas, semicolons or tabs stand between the columns" if is_doubled else ""
        yield "count", f"{wrong_count(cell_count, len(cells))}{hint}"
        return
    for index in rows.used:
        name, cell = rows.name(index), cells[index]
        if rows.empty_cells and is_missing(cell):
            continue
        try:
            number = with_point(cell)
        except _IrregularError:
            number, hint = "", "; the decimal sign is a comma in some cells and a point in others"
            hint = hint if separator != "," and _DECIMAL_COMMA.fullmatch(cell.replace(".", ",")) else ""
        else:
            hint = "; delete the row, or fill in the value" if is_missing(cell) else ""
        if not is_number(number):
            yield name, f"column {name}: expected a number, found {cell.strip()[:40]!r}{hint}"
