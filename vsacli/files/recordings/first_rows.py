"""The first rows of a table as texts, and the kinds of its columns.

The column of stamps is identified first, with its unit.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from typing import NamedTuple

import numpy as np

from vsacli.base.errors import InputError
from vsacli.documents.column_mapping import MappedColumn
from vsacli.documents.csv_file import Header, RowsToRead, is_missing, is_number, read_header, split_heading
from vsacli.documents.table import find_surroundings
from vsacli.documents.time_column import (
    EXPECTED,
    NAMES,
    REST,
    SECONDS,
    STEPS,
    UNIT_WORDS_OF_TIMES,
    UNITS_IN_NAMES,
    ClockTime,
    are_seconds_and_nanoseconds,
    guessed_unit,
    read_clock,
)
from vsacli.trajectory.recorded.header_words import QUANTITY_WORDS, WORDS, words_of_column_name

FIRST_ROWS = 500
"""Number of rows read, enough to distinguish numbers from texts, and stamps from counters."""

INDICES = (
    "index",
    "idx",
    "row",
    "unnamed: 0",
    "sample",
    "nr",
    "no",
    "number",
    "count",
    "counter",
    "seq",
    "id",
)
"""Names of columns that count rows."""

EVEN_SHARE = 0.9
"""Smallest share of nearly even intervals of a column guessed to be times; a faulty log has others."""

GUESSED = "guessed"
"""Beginning of the reason if a column is taken for times although its name does not indicate it."""

UNITS_IN_ROWS = {
    **dict.fromkeys(("second", "seconds", "sec"), "s"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    **dict.fromkeys(("degree", "degrees"), "deg"),
    **UNIT_WORDS_OF_TIMES,
    **dict.fromkeys(("", "-", "1", "none", "n/a")),
}
"""Units by the lower-case words with which rows of units mention them; other cells are units as they are."""

_LIST = re.compile(r"[(\[]\s*(.+?)[,.]?\s*[)\]]")
_BETWEEN_VALUES = re.compile(r"[,;]\s*|[.]?\s+")

EVEN = 0.5
"""Largest relative deviation from the median of nearly all intervals, for columns guessed to be times."""


@dataclass(frozen=True)
class FirstRows:
    """The first rows of a table.

    Attributes:
        path: path of the file.
        header: header of the file.
        cells: texts, (rows, columns), with decimal points.
        skip_rows: numbers of lines that are neither header nor rows.
        units: units of the columns in a row of their own; empty texts where there is none.
    """

    path: str
    header: Header
    cells: Sequence[Sequence[str]]
    skip_rows: tuple[int, ...] = ()
    units: Sequence[str] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return self.header.columns

    def filled(self, index: int) -> list[str]:
        """Return the cells of a column that are not empty."""
        return [row[index] for row in self.cells if not is_missing(row[index])]

    def numbers(self, index: int) -> list[float]:
        """Return the numbers of a column; an empty list if it holds anything else."""
        cells = self.filled(index)
        return [float(cell) for cell in cells] if all(map(is_number, cells)) else []

    def clocks(self, index: int) -> list[ClockTime]:
        """Return the times of a column of clock texts; an empty list if it holds anything else."""
        clocks = [clock for cell in self.filled(index) if (clock := read_clock(cell)) is not None]
        return clocks if len(clocks) == len(self.filled(index)) else []

    def is_index(self, index: int) -> bool:
        """Return whether a column counts the rows: named as an index or not at all, and increasing by one."""
        name = split_heading(self.columns[index])[0].lower()
        is_named_index = (not name and self.header.line > 0) or name in INDICES
        return is_named_index and self.counts_rows(index)

    def counts_rows(self, index: int) -> bool:
        """Return whether the numbers of a column increase by one from row to row."""
        values = self.numbers(index)
        return len(values) > 1 and all(after - before == 1 for before, after in pairwise(values))

    def unit(self, index: int) -> str | None:
        """Return the unit of a column, in brackets after its name or in a row of units; None without one."""
        unit_in_heading = split_heading(self.columns[index])[1]
        unit_in_row = self.units[index].strip("[]() ") if self.units else ""
        return (
            UNITS_IN_ROWS.get(unit_in_row.lower(), unit_in_row)
            if unit_in_heading is None
            else unit_in_heading
        )

    def list_length(self, index: int) -> int:
        """Return the number of values in each cell of a column of lists; 0 if it holds anything else."""
        matches = [_LIST.fullmatch(cell.strip()) for cell in self.filled(index)]
        lengths = {len(_BETWEEN_VALUES.split(match[1])) if match else 0 for match in matches}
        return lengths.pop() if len(lengths) == 1 else 0

    def text(self, index: int) -> str:
        """Return the text common to all rows of a column; "" for numbers, or for several texts."""
        texts = set(self.filled(index))
        return texts.pop() if len(texts) == 1 and not self.numbers(index) else ""

    def called(self, index: int) -> str | int:
        """Return the key of a column in mappings: its name, or its number if that is empty or repeated."""
        name = self.columns[index]
        return name if name and self.columns.count(name) == 1 else index + 1

    @property
    def of_numbers(self) -> list[int]:
        """Positions of the columns that hold numbers."""
        return [index for index in range(len(self.columns)) if self.numbers(index)]


def read_first_rows(path: str | os.PathLike[str]) -> FirstRows:
    """Return the first rows of a CSV file with any column names.

    Raises:
        InputError: the file does not begin like a table, or a row does not fit the header.
    """
    name = os.fspath(path)
    lines, _, units = find_surroundings(name)
    header = read_header(name, numbered_columns=(1,), skipped=lines)
    decimal_point = "," if header.separator == "," else "."
    rows = islice(RowsToRead(name, header, (), empty_cells=True).texts(), FIRST_ROWS)
    cells = [[cell.replace(",", decimal_point) for cell in row] for _, row in rows]
    if not cells:
        raise InputError.one("has a header but no rows of values", name)
    return FirstRows(name, header, cells, lines, units)


class TimeColumn(NamedTuple):
    """The column of stamps of a recording.

    Attributes:
        place: position of the column, from 0.
        source: entry of the column in a mapping.
        reason: reason for the choice, a clause.
        nanoseconds: position of its column of nanoseconds, if there is one.
        unit_guessed: whether the unit was derived from the size of the steps.
    """

    place: int
    source: MappedColumn
    reason: str
    nanoseconds: int | None = None
    unit_guessed: bool = False


def time_columns(rows: FirstRows) -> Iterator[TimeColumn]:
    """Yield columns that may be stamps, best first: by their names, clock texts, or even intervals."""
    pair = _seconds_and_nanoseconds(rows)
    if pair is not None:
        seconds, nanoseconds = map(rows.called, pair)
        source = MappedColumn(column=seconds, nanoseconds=nanoseconds)
        yield TimeColumn(pair[0], source, "seconds and nanoseconds", pair[1])
    named_times, all_indices = _columns_named_time(rows), range(len(rows.columns))
    candidates = dict.fromkeys((*named_times, *(index for index in all_indices if rows.clocks(index))))
    stamps = [index for index in candidates if rows.numbers(index) or rows.clocks(index)]
    changing = [index for index in stamps if len(set(rows.filled(index))) > 1 and not rows.is_index(index)]
    yield from (_time_column(rows, index, "") for index in changing)
    guess = (
        None
        if named_times
        else next(filter(lambda place: _looks_like_stamps(rows, place), rows.of_numbers), None)
    )
    if guess is not None:
        yield _time_column(rows, guess, f"{GUESSED}: it increases in nearly even steps")


def unread_times(rows: FirstRows) -> Iterator[str]:
    """Yield the problems of columns named as times if none of them can be read as such."""
    if next(time_columns(rows), None) is not None:
        return
    for index in _columns_named_time(rows):
        name, cells = rows.columns[index], rows.filled(index)
        if rows.numbers(index) or rows.clocks(index):
            yield f"column {name!r} is called a time, but is the same in all rows"
        elif cells:
            unread_cells = (cell for cell in cells if not is_number(cell) and read_clock(cell) is None)
            text = next(unread_cells, cells[0])  # numbers and clock texts mixed
            yield f"column {name!r} is called a time, but holds {text[:40]!r}; expected {EXPECTED}"


def _time_column(rows: FirstRows, index: int, reason: str) -> TimeColumn:
    column = rows.called(index)
    if rows.clocks(index):
        return TimeColumn(index, MappedColumn(column=column), "as a clock shows it")
    declared_unit = rows.unit(index) or MappedColumn(column=column).undeclared_unit(rows.columns[index])
    unit, unit_reason = guessed_unit(rows.numbers(index)) if declared_unit is None else (declared_unit, "")
    is_guessed = unit is not None and STEPS in unit_reason
    unit_reason = f"unit {GUESSED}: {unit_reason}" if is_guessed else unit_reason
    reasons = "; ".join(filter(None, (reason, unit_reason)))
    return TimeColumn(index, MappedColumn(column=column, unit=unit), reasons, unit_guessed=is_guessed)


def _columns_named_time(rows: FirstRows) -> list[int]:
    """Return columns named as times, best first: matches of the whole name before those of its last word."""
    whole_matches, last_word_matches = {}, {}
    for index, column in enumerate(rows.columns):
        name = split_heading(column)[0].strip().lower()
        words = [word.lower() for word in WORDS.findall(split_heading(column)[0])]
        while len(words) > 1 and words[-1] in UNITS_IN_NAMES:
            words.pop()
        if name in NAMES:
            whole_matches[index] = NAMES.index(name)
        elif words and words[-1] in NAMES and not rows.is_index(index):
            last_word_matches[index] = NAMES.index(words[-1])
    return [
        *sorted(whole_matches, key=lambda place: whole_matches[place]),
        *sorted(last_word_matches, key=lambda place: last_word_matches[place]),
    ]


def _looks_like_stamps(rows: FirstRows, index: int) -> bool:
    """Return whether a column, not named as a quantity, rises nearly evenly and does not count rows."""
    words = words_of_column_name(split_heading(rows.columns[index])[0])
    if QUANTITY_WORDS.intersection(words) or rows.counts_rows(index):
        return False
    steps = np.diff(rows.numbers(index))
    median_step = float(np.median(steps)) if steps.size else 0.0
    return median_step > 0 and bool(np.mean(np.abs(steps - median_step) <= EVEN * median_step) > EVEN_SHARE)


def _seconds_and_nanoseconds(rows: FirstRows) -> tuple[int, int] | None:
    """Return columns of whole seconds and of nanoseconds that restart, by name or as seconds since 1970."""
    words = [words_of_column_name(split_heading(column)[0]) for column in rows.columns]
    for index in rows.of_numbers:
        *prefix, last_word = words[index] or ("",)
        nanosecond_columns = [
            other_index
            for other_index in rows.of_numbers
            if words[other_index] in [(*prefix, rest) for rest in REST]
        ]
        seconds = rows.numbers(index) if last_word in SECONDS and nanosecond_columns else ()
        if seconds and are_seconds_and_nanoseconds(seconds, rows.numbers(nanosecond_columns[0]), least=0):
            return index, nanosecond_columns[0]
    for index in rows.of_numbers[:-1]:
        if are_seconds_and_nanoseconds(rows.numbers(index), rows.numbers(index + 1), least=1e8):
            return index, index + 1
    return None
