"""Lines of a table that are neither header nor rows: a preamble above the header, rows of units below it."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from vsacli.base.errors import InputError
from vsacli.base.storage import place_of
from vsacli.base.texts import counted
from vsacli.documents.csv_file import (
    SEPARATORS,
    Header,
    filled_lines,
    is_missing,
    is_number,
    separator_of,
    split_cells,
    split_heading,
)
from vsacli.documents.time_column import NAMES, read_clock

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
    for top in range(min(MOST_ABOVE, len(lines) - FEWEST_ROWS)):
        texts = _texts_below([content for _, content in lines], top)
        if texts is not None:
            below = range(top + 1, top + 1 + len(texts))
            numbers = tuple(lines[at][0] for at in (*range(top), *below))
            return Surroundings(numbers, lines[top][0], texts[0] if texts else ())
    return Surroundings()


def _texts_below(lines: Sequence[str], top: int) -> list[tuple[str, ...]] | None:
    """Return the rows of texts below a line if it is a header or the first row of a table; else None."""
    separator = separator_of(lines[top])
    rows = [tuple(cell.strip() for cell in split_cells(line, separator)) for line in lines]
    width = len(rows[top])
    if width < 2 or any(len(row) != width for row in rows[top:]):
        return None
    values = [sum(_is_value(cell, separator) for cell in row) for row in rows]
    is_row = [count > 0 or all(map(is_missing, row)) for row, count in zip(rows, values, strict=True)]
    first = next((at for at in range(top + 1, len(rows)) if is_row[at]), len(rows))
    enough = len(rows) - first >= FEWEST_ROWS and all(is_row[first:]) and first - top <= 1 + MOST_TEXTS
    rows_above = any(len(row) == width <= 2 * count for row, count in zip(rows[:top], values, strict=False))
    late = any(map(_names_times, rows[top + 1 : first])) and not _names_times(rows[top])
    return rows[top + 1 : first] if enough and not rows_above and not late else None


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
        above = sum(line < header for line in lines)
        clauses = [f"{counted(above, 'line')} above the header in line {header}"] if above else []
        clauses += [f"below it a row of texts, such as units: {', '.join(units)[:60]}"] if units else []
        message = (
            f"has {' and '.join(clauses)}; leave them out by skip_rows: {list(lines)} next to `file` or in a"
            f" columns file; vsacli info {name} --robot ROBOT --field trajectory writes this"
        )
        raise InputError.one(message, name, lines[0]) from None
