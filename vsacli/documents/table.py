"""Strict reading of CSV tables: a header line, then numbers. Robots and trajectories are unknown here.

Some tables have lines that are neither header nor rows: a preamble above the header, rows of units below it.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import BinaryIO, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.base.errors import InputError
from vsacli.base.storage import place_of
from vsacli.base.texts import counted
from vsacli.documents.column_mapping import AS_NAMED, ChosenColumns, ColumnMapping
from vsacli.documents.csv_file import (
    CHUNK,
    MAX_BYTES,
    SEPARATORS,
    Header,
    RowsToRead,
    filled_lines,
    header_of,
    is_missing,
    is_number,
    read_numbers,
    separator_of,
    split_cells,
    split_heading,
)
from vsacli.documents.source import (
    MAX_DOCUMENT_BYTES,
    Source,
    check_input_file,
    decode_utf8,
    recognizing_other_formats,
    refuse_other_formats,
)
from vsacli.documents.time_column import NAMES, TIME, read_clock, read_clocks, read_stamps, shows_a_clock

SEARCHED, MOST_LINES = 100_000, 300  # characters and lines searched; all lines below a header are to be rows
MOST_ABOVE, MOST_TEXTS = 100, 3  # lines of a preamble; rows of units and remarks below a header
FEWEST_ROWS = 3  # fewer could be either
NO_HEADER = Header(0, SEPARATORS[-1], ())


class Surroundings(NamedTuple):
    """The lines around the header of a table that are no rows.

    Attributes:
        lines: numbers of these lines, ascending.
        header: number of the line of the header, or of the first row of a table without header.
        units: cells of the first row of texts below the header; empty without one.
    """

    lines: tuple[int, ...] = ()
    header: int = 1
    units: tuple[str, ...] = ()


def find_surroundings(path: str | os.PathLike[str]) -> Surroundings:
    """Return the lines that a reader must skip; none if the header is in the first line, or is not found."""
    try:
        with open(place_of(path), encoding="utf-8-sig", errors="replace") as file:
            beginning = file.read(SEARCHED).split("\n")[:MOST_LINES]
    except OSError:
        return Surroundings()
    lines = list(filled_lines(beginning, NO_HEADER))
    for top_index in range(min(MOST_ABOVE, len(lines) - FEWEST_ROWS)):
        texts = _texts_below([content for _, content in lines], top_index)
        if texts is not None:
            text_indices = range(top_index + 1, top_index + 1 + len(texts))
            numbers = tuple(lines[index][0] for index in (*range(top_index), *text_indices))
            return Surroundings(numbers, lines[top_index][0], texts[0] if texts else ())
    return Surroundings()


def _texts_below(lines: Sequence[str], top_index: int) -> list[tuple[str, ...]] | None:
    """Return the rows of texts below a line if it is a header or the first row of a table; else None."""
    separator = separator_of(lines[top_index])
    rows = [tuple(cell.strip() for cell in split_cells(line, separator)) for line in lines]
    width = len(rows[top_index])
    if width < 2 or any(len(row) != width for row in rows[top_index:]):
        return None
    value_counts = [sum(_is_value(cell, separator) for cell in row) for row in rows]
    is_row = [count > 0 or all(map(is_missing, row)) for row, count in zip(rows, value_counts, strict=True)]
    first_row = next((index for index in range(top_index + 1, len(rows)) if is_row[index]), len(rows))
    has_enough_rows = (
        len(rows) - first_row >= FEWEST_ROWS
        and all(is_row[first_row:])
        and first_row - top_index <= 1 + MOST_TEXTS
    )
    rows_above = any(
        len(row) == width <= 2 * count for row, count in zip(rows[:top_index], value_counts, strict=False)
    )
    is_below_header = any(map(_names_times, rows[top_index + 1 : first_row])) and not _names_times(
        rows[top_index]
    )
    return (
        rows[top_index + 1 : first_row]
        if has_enough_rows and not rows_above and not is_below_header
        else None
    )


def _names_times(row: Sequence[str]) -> bool:
    """Return whether a row is a header, since one of its cells is a name of times."""
    return any(split_heading(cell)[0].strip().lower() in NAMES for cell in row)


def _is_value(cell: str, separator: str) -> bool:
    return is_number(cell.replace(",", "," if separator == "," else ".")) or read_clock(cell) is not None


@contextmanager
def naming_lines_to_skip(name: str, skipped: Collection[int]) -> Iterator[None]:
    """Replace an InputError within this context if lines around the header are its likely cause.

    Raises:
        InputError: with the lines and the key that leaves them out.
    """
    try:
        yield
    except InputError:
        lines, header, units = find_surroundings(name)
        if set(lines) <= set(skipped):
            raise
        above_count = sum(line < header for line in lines)
        clauses = [f"{counted(above_count, 'line')} above the header in line {header}"] if above_count else []
        clauses += [f"below it a row of texts, such as units: {', '.join(units)[:60]}"] if units else []
        message = (
            f"has {' and '.join(clauses)}; leave them out by skip_rows: {list(lines)} next to `file` or in a"
            f" columns file; vsacli info {name} --robot ROBOT --field trajectory writes this"
        )
        raise InputError.one(message, name, lines[0]) from None


SAME_STAMP = 1e-3
"""Largest difference of equal stamps, in intervals of a signal: a joint at 1 rad/s moves by 1e-5 rad within
it if there are 100 rows in a second."""


@dataclass(frozen=True, eq=False)
class CsvTable:
    """A table read from a file.

    Attributes:
        columns: names of the columns read, each with its unit in brackets if one is known.
        values: finite values, (rows, columns), with at least one row if there is a column; NaN in empty
            cells, if these are allowed.
        source: file that was read.
        header: header of the file.
        unknown_columns: names of columns that were not read because they are unknown.
        ignored: names of columns that the mapping leaves out.
        first_stamp: first time, which was subtracted, if times were too large for floating point or clock
            texts.
        kept: indices (rows,) of the rows in the file; None if all rows are kept.
        rated: whether the file has no times, and they were computed from the rate of the mapping.
        hollow: names of columns that were left out since they hold no number.
        joined: number of rows that were joined to the row before them.
    """

    columns: tuple[str, ...]
    values: FloatArray = field(repr=False)
    source: Source
    header: Header = NO_HEADER
    unknown_columns: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    first_stamp: int | str | None = None
    kept: IndexArray | None = field(repr=False, default=None)
    rated: bool = False
    hollow: tuple[str, ...] = ()
    joined: int = 0

    @cached_property
    def lines(self) -> RowLines:
        """Line numbers of the rows in the file."""
        return RowLines(self.source.path, self.header, self.kept)

    def line_of(self, row: int) -> int:
        """Return the line number of a row counted from 0; 0 if the file no longer exists."""
        return self.lines.of(row)

    def without_empty_rows(self, *, stamped: bool = False) -> CsvTable:
        """Return the rows with a number in any column but the time; others are of other topics of a log.

        Args:
            stamped: whether to keep rows with no number but the time, which may be the beginning of the log.
        """
        cells = self.values if stamped else self.values[:, self._signals]
        has_number = ~np.isnan(cells).all(axis=1)
        if has_number.all() or not has_number.any():
            return self
        return replace(self, values=self.values[has_number], kept=np.flatnonzero(has_number))

    def without_hollow_columns(self) -> CsvTable:
        """Return the columns that hold a number; the others become `hollow`."""
        is_empty = np.isnan(self.values).all(axis=0) & (len(self.values) > 0)
        if not is_empty.any():
            return self
        full_indices = np.flatnonzero(~is_empty).tolist()
        hollow = tuple(split_heading(self.columns[index])[0] for index in np.flatnonzero(is_empty).tolist())
        return replace(
            self,
            columns=tuple(self.columns[at] for at in full_indices),
            values=self.values[:, full_indices],
            hollow=hollow,
        )

    def with_joined_rows(self) -> CsvTable:
        """Return the table with rows joined whose stamps are nearly equal, and that fill different columns.

        Some loggers write one row for each signal of a message, a nanosecond apart. Nothing is joined if two
        of such rows hold numbers in the same column.
        """
        has_number = ~np.isnan(self.values[:, self._signals])
        time_column = next((index for index in range(len(self.columns)) if index not in self._signals), None)
        if time_column is None or has_number.all() or not has_number.any():
            return self
        stamps = self.values[:, time_column]
        intervals = np.abs(np.diff(stamps[has_number[:, int(np.argmax(has_number.sum(axis=0)))]]))
        # seconds since 1970 have 7 decimals in floating point
        rounding = 2 * float(np.spacing(np.abs(stamps).max()))
        stamp_tolerance = max(rounding, SAME_STAMP * float(np.median(intervals)) if intervals.size else 0.0)
        starts = np.append(0, np.flatnonzero(~(np.abs(np.diff(stamps)) <= stamp_tolerance)) + 1)
        filled_counts = np.add.reduceat(has_number.astype(int), starts, axis=0)
        if len(starts) == len(stamps) or filled_counts.max() > 1:
            return self
        values = np.add.reduceat(np.nan_to_num(self.values), starts, axis=0)
        values[:, self._signals] = np.where(filled_counts > 0, values[:, self._signals], np.nan)
        values[:, time_column] = stamps[starts]
        kept = starts if self.kept is None else self.kept[starts]
        return replace(self, values=values, kept=kept, joined=len(stamps) - len(starts))

    @cached_property
    def _signals(self) -> list[int]:
        """Positions of the columns other than the time."""
        return [index for index, name in enumerate(self.columns) if split_heading(name)[0] != TIME]


@dataclass(frozen=True, eq=False)
class RowLines:
    """Line numbers of the rows of a table, found by reading the file once more.

    Attributes:
        path: path of the file.
        header: header of the table.
        kept: indices (rows,) of the rows in the file; None if all rows are kept.
    """

    path: str
    header: Header
    kept: IndexArray | None = None

    def of(self, row: int) -> int:
        """Return the line number of a row counted from 0; 0 if the file no longer exists."""
        file_row = row if self.kept is None else int(self.kept[row])
        return int(self._numbers[file_row]) if file_row < len(self._numbers) else 0

    @cached_property
    def _numbers(self) -> IndexArray:
        try:
            with open(place_of(self.path), encoding="utf-8-sig", errors="replace") as file:
                numbers = [number for number, _ in filled_lines(file, self.header)]
        except OSError:
            numbers = []
        return np.array(numbers, dtype=np.intp)


def read_table(
    path: str | os.PathLike[str],
    mapping: ColumnMapping = AS_NAMED,
    readable_names: Collection[str] | None = None,
    *,
    empty_cells: bool = False,
) -> CsvTable:
    """Read a CSV file, at about the cost in time and memory of `numpy.loadtxt`.

    The first line names the columns, quoted or not; a tab, semicolon or comma in it is the separator, else
    blanks are. With separators other than the comma, numbers may have decimal commas. Comments go from `#` to
    the end of a line. Lines without other content are skipped, also before the header.

    Args:
        path: path of the file; UTF-8, with or without a byte order mark.
        mapping: names of foreign columns, and columns to leave out.
        readable_names: names of columns to read, if present; all if None.
        empty_cells: whether cells may be empty, or hold `nan`, `NA` or the like.

    Raises:
        InputError: with file and line of every problem.
    """
    name = os.fspath(path)
    check_input_file(name, MAX_BYTES)
    try:
        with recognizing_other_formats(name), naming_lines_to_skip(name, mapping.skip_rows):
            with open(place_of(name), "rb") as content:
                header = header_of(
                    content,
                    name,
                    strict=not mapping,
                    numbered_columns=mapping.numbers,
                    skipped=mapping.skip_rows,
                )
                digest, text = _digest_and_text(content, name)
            chosen = mapping.choose_columns(header, readable_names, name)
            headings, values, first_stamp = _read_values(name, header, chosen, empty_cells)
            rated = mapping.rate is not None and chosen.time is None and len(values) > 0
            if rated:
                headings = (*headings, TIME)
                values = np.column_stack([values, np.arange(len(values)) / (mapping.rate or 1)])
            source = Source(name, digest, None if text is None else decode_utf8(text, name))
    except OSError as error:
        raise InputError.one(f"cannot be read: {error.strerror or error}", name) from None
    if not chosen.places:
        refuse_other_formats(name)
    return CsvTable(
        headings,
        values,
        source,
        header,
        chosen.unknown_columns,
        chosen.ignored,
        first_stamp=first_stamp,
        rated=rated,
    )


def _digest_and_text(content: BinaryIO, name: str) -> tuple[str, bytes | None]:
    """Return the SHA-256 of a file, and its content if kept; refuse NUL characters and very long lines."""
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


def _read_values(
    name: str, header: Header, chosen: ChosenColumns, empty_cells: bool
) -> tuple[tuple[str, ...], FloatArray, int | str | None]:
    """Return headings and numbers of the columns, and the first stamp if it was subtracted from the times."""
    if not chosen.places:
        return chosen.headings, np.empty((0, 0)), None
    rows = RowsToRead(name, header, chosen.places, empty_cells)
    if chosen.time is None:
        return chosen.headings, _apply_factors(read_numbers(rows), chosen), None
    headings, column = chosen.headings, chosen.places.index(chosen.time)
    times = rows._replace(used=(chosen.time,))
    if shows_a_clock(times._replace(empty_cells=True)):
        other_places = [place for place in chosen.places if place != chosen.time]
        numbers = read_numbers(rows._replace(used=other_places)) if other_places else np.empty((0, 0))
        first, stamps = read_clocks(times)
        values = np.insert(numbers, column, stamps, axis=1) if other_places else stamps[:, None]
        heading = f"{split_heading(headings[column])[0]} [ns]"
        headings = (*headings[:column], heading, *headings[column + 1 :])
        return headings, _apply_factors(values, chosen), first
    values = read_numbers(rows)
    since, values[:, column] = read_stamps(rows, chosen.time, chosen.nanoseconds, values[:, column])
    if since is not None:
        _check_unit(since, headings[column], name, header.line)
    return headings, _apply_factors(values, chosen), since


def _apply_factors(values: FloatArray, chosen: ChosenColumns) -> FloatArray:
    for column, factor in enumerate(chosen.factors):
        if factor != 1:
            values[:, column] *= factor
    return values


def _check_unit(first: int, heading: str, name: str, line: int) -> None:
    if split_heading(heading)[1] is None:
        say = f"columns: {{{TIME}: {{column: ..., unit: ns}}}}, or {TIME} [ns] in the header"
        message = (
            f"the times begin with {first}, which are no seconds since any instant; say their unit: {say}"
        )
        raise InputError.one(message, name, line)
