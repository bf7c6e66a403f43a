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

    def filled(self, place: int) -> list[str]:
        """Return the cells of a column that are not empty."""
        return [row[place] for row in self.cells if not is_missing(row[place])]

    def numbers(self, place: int) -> list[float]:
        """Return the numbers of a column; an empty list if it holds anything else."""
        cells = self.filled(place)
        return [float(cell) for cell in cells] if all(map(is_number, cells)) else []

    def clocks(self, place: int) -> list[ClockTime]:
        """Return the times of a column of clock texts; an empty list if it holds anything else."""
        clocks = [clock for cell in self.filled(place) if (clock := read_clock(cell)) is not None]
        return clocks if len(clocks) == len(self.filled(place)) else []

    def is_index(self, place: int) -> bool:
        """Return whether a column counts the rows: named as an index or not at all, and increasing by one."""
        name = split_heading(self.columns[place])[0].lower()
        named_so = (not name and self.header.line > 0) or name in INDICES
        return named_so and self.counts_rows(place)

    def counts_rows(self, place: int) -> bool:
        """Return whether the numbers of a column increase by one from row to row."""
        values = self.numbers(place)
        return len(values) > 1 and all(after - before == 1 for before, after in pairwise(values))

    def unit(self, place: int) -> str | None:
        """Return the unit of a column, in brackets after its name or in a row of units; None without one."""
        written = split_heading(self.columns[place])[1]
        below = self.units[place].strip("[]() ") if self.units else ""
        return UNITS_IN_ROWS.get(below.lower(), below) if written is None else written

    def list_length(self, place: int) -> int:
        """Return the number of values in each cell of a column of lists; 0 if it holds anything else."""
        lists = [_LIST.fullmatch(cell.strip()) for cell in self.filled(place)]
        lengths = {len(_BETWEEN_VALUES.split(found[1])) if found else 0 for found in lists}
        return lengths.pop() if len(lengths) == 1 else 0

    def text(self, place: int) -> str:
        """Return the text common to all rows of a column; "" for numbers, or for several texts."""
        texts = set(self.filled(place))
        return texts.pop() if len(texts) == 1 and not self.numbers(place) else ""

    def called(self, place: int) -> str | int:
        """Return the key of a column in mappings: its name, or its number if that is empty or repeated."""
        name = self.columns[place]
        return name if name and self.columns.count(name) == 1 else place + 1

    @property
    def of_numbers(self) -> list[int]:
        """Positions of the columns that hold numbers."""
        return [place for place in range(len(self.columns)) if self.numbers(place)]


def read_first_rows(path: str | os.PathLike[str]) -> FirstRows:
    """Return the first rows of a CSV file with any column names.

    Raises:
        InputError: the file does not begin like a table, or a row does not fit the header.
    """
    name = os.fspath(path)
    lines, _, units = find_surroundings(name)
    header = read_header(name, numbered_columns=(1,), skipped=lines)
    point = "," if header.separator == "," else "."
    rows = islice(RowsToRead(name, header, (), empty_cells=True).texts(), FIRST_ROWS)
    cells = [[cell.replace(",", point) for cell in row] for _, row in rows]
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
        seconds, rest = map(rows.called, pair)
        source = MappedColumn(column=seconds, nanoseconds=rest)
        yield TimeColumn(pair[0], source, "seconds and nanoseconds", pair[1])
    called, every = _called(rows), range(len(rows.columns))
    named = dict.fromkeys((*called, *(place for place in every if rows.clocks(place))))
    stamps = [place for place in named if rows.numbers(place) or rows.clocks(place)]
    moving = [place for place in stamps if len(set(rows.filled(place))) > 1 and not rows.is_index(place)]
    yield from (_described(rows, place, "") for place in moving)
    guess = None if called else next(filter(lambda place: _like_stamps(rows, place), rows.of_numbers), None)
    if guess is not None:
        yield _described(rows, guess, f"{GUESSED}: it increases in nearly even steps")


def unread_times(rows: FirstRows) -> Iterator[str]:
    """Yield the problems of columns named as times if none of them can be read as such."""
    if next(time_columns(rows), None) is not None:
        return
    for place in _called(rows):
        name, filled = rows.columns[place], rows.filled(place)
        if rows.numbers(place) or rows.clocks(place):
            yield f"column {name!r} is called a time, but is the same in all rows"
        elif filled:
            unread = (cell for cell in filled if not is_number(cell) and read_clock(cell) is None)
            text = next(unread, filled[0])  # numbers and clock texts mixed
            yield f"column {name!r} is called a time, but holds {text[:40]!r}; expected {EXPECTED}"


def _described(rows: FirstRows, place: int, reason: str) -> TimeColumn:
    column = rows.called(place)
    if rows.clocks(place):
        return TimeColumn(place, MappedColumn(column=column), "as a clock shows it")
    own = rows.unit(place) or MappedColumn(column=column).undeclared_unit(rows.columns[place])
    unit, why = guessed_unit(rows.numbers(place)) if own is None else (own, "")
    by_steps = unit is not None and STEPS in why
    why = f"unit {GUESSED}: {why}" if by_steps else why
    reasons = "; ".join(filter(None, (reason, why)))
    return TimeColumn(place, MappedColumn(column=column, unit=unit), reasons, unit_guessed=by_steps)


def _called(rows: FirstRows) -> list[int]:
    """Return columns named as times, best first: matches of the whole name before those of its last word."""
    whole, last = {}, {}
    for place, column in enumerate(rows.columns):
        name = split_heading(column)[0].strip().lower()
        words = [word.lower() for word in WORDS.findall(split_heading(column)[0])]
        while len(words) > 1 and words[-1] in UNITS_IN_NAMES:
            words.pop()
        if name in NAMES:
            whole[place] = NAMES.index(name)
        elif words and words[-1] in NAMES and not rows.is_index(place):
            last[place] = NAMES.index(words[-1])
    return [*sorted(whole, key=lambda place: whole[place]), *sorted(last, key=lambda place: last[place])]


def _like_stamps(rows: FirstRows, place: int) -> bool:
    """Return whether a column, not named as a quantity, rises nearly evenly and does not count rows."""
    words = words_of_column_name(split_heading(rows.columns[place])[0])
    if QUANTITY_WORDS.intersection(words) or rows.counts_rows(place):
        return False
    steps = np.diff(rows.numbers(place))
    usual = float(np.median(steps)) if steps.size else 0.0
    return usual > 0 and bool(np.mean(np.abs(steps - usual) <= EVEN * usual) > EVEN_SHARE)


def _seconds_and_nanoseconds(rows: FirstRows) -> tuple[int, int] | None:
    """Return columns of whole seconds and of nanoseconds that restart, by name or as seconds since 1970."""
    words = [words_of_column_name(split_heading(column)[0]) for column in rows.columns]
    for place in rows.of_numbers:
        *before, last = words[place] or ("",)
        named = [other for other in rows.of_numbers if words[other] in [(*before, rest) for rest in REST]]
        seconds = rows.numbers(place) if last in SECONDS and named else ()
        if seconds and are_seconds_and_nanoseconds(seconds, rows.numbers(named[0]), least=0):
            return place, named[0]
    for place in rows.of_numbers[:-1]:
        if are_seconds_and_nanoseconds(rows.numbers(place), rows.numbers(place + 1), least=1e8):
            return place, place + 1
    return None
