"""The first rows of a table as texts, from which one sees what its columns are."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np

from vsacli.base.errors import InputError
from vsacli.documents.clocks import Clock, elapsed, read_clock
from vsacli.documents.table_header import Header, cells_of, is_number, read_header, split_heading
from vsacli.documents.table_rows import NOTHING, Rows

FIRST_ROWS = 500
"""Enough to tell numbers from texts, and stamps from counters."""

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
"""What columns are called that count rows, if they have a name."""

RISING_SHARE = 0.9
"""Of the steps of stamps, how many must be positive: in a log with faults some are not."""


@dataclass(frozen=True)
class FirstRows:
    """The first rows of a table.

    Attributes:
        path: the file.
        header: its header.
        cells: (rows, columns), with decimal points.
    """

    path: str
    header: Header
    cells: Sequence[Sequence[str]]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return self.header.columns

    def filled(self, place: int) -> list[str]:
        """The cells of a column that hold something."""
        return [row[place] for row in self.cells if row[place].strip().lower() not in NOTHING]

    def numbers(self, place: int) -> list[float]:
        """The numbers of a column; nothing if it holds anything else."""
        cells = self.filled(place)
        return [float(cell) for cell in cells] if all(map(is_number, cells)) else []

    def clocks(self, place: int) -> list[Clock]:
        """The times of a column that is written as a clock shows them; nothing if it holds anything else."""
        clocks = [clock for cell in self.filled(place) if (clock := read_clock(cell)) is not None]
        return clocks if len(clocks) == len(self.filled(place)) else []

    def is_index(self, place: int) -> bool:
        """Whether a column counts the rows: nameless or called so, and larger by one from row to row."""
        name = split_heading(self.columns[place])[0].lower()
        named_so = (not name and self.header.line > 0) or name in INDICES
        return named_so and self.counts_rows(place)

    def counts_rows(self, place: int) -> bool:
        """Whether the whole numbers of a column are larger by one from row to row."""
        values = self.numbers(place)
        return len(values) > 1 and all(after - before == 1 for before, after in pairwise(values))

    def text(self, place: int) -> str:
        """What each row says in a column; nothing if these are numbers, or not always the same."""
        texts = set(self.filled(place))
        return texts.pop() if len(texts) == 1 and not self.numbers(place) else ""

    def called(self, place: int) -> str | int:
        """A column as mappings name it: its number where there is no name, or it is repeated."""
        name = self.columns[place]
        return name if name and self.columns.count(name) == 1 else place + 1

    @property
    def of_numbers(self) -> list[int]:
        """Places of the columns that hold numbers."""
        return [place for place in range(len(self.columns)) if self.numbers(place)]

    def rises(self, place: int) -> bool:
        """Whether the numbers or times of a column, two at least, nearly always increase from row to row."""
        cells = self.filled(place)
        clocks = self.clocks(place)
        if clocks:
            return len(clocks) > 1 and bool(np.mean(np.diff(elapsed(clocks)) > 0) > RISING_SHARE)
        try:
            values: Sequence[float] = [int(cell) for cell in cells]  # floats tell no nanoseconds apart
        except ValueError:
            values = self.numbers(place) or [math.nan]
        steps = [after > before for before, after in pairwise(values)]
        return sum(steps) > RISING_SHARE * len(steps)


def read_first_rows(path: str | os.PathLike[str]) -> FirstRows:
    """The first rows of a CSV file, whatever its columns are called.

    Raises:
        InputError: it begins as no table does, or rows have other cells than the header.
    """
    name = os.fspath(path)
    header = read_header(name, numbered=(1,))
    point = "," if header.separator == "," else "."
    cells = []
    for number, line in islice(Rows(name, header, (), empty_cells=True).lines(), FIRST_ROWS):
        row = [cell.replace(",", point) for cell in cells_of(line, header.separator)]
        if len(row) != len(header.columns):
            message = f"expected {len(header.columns)} values as in the header, found {len(row)}"
            raise InputError.one(message, name, number)
        cells.append(row)
    if not cells:
        raise InputError.one("there are no rows below the header", name)
    return FirstRows(name, header, cells)
