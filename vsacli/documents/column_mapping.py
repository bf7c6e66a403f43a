"""Mappings from columns of a table to names of this package, and their application to a header."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError, Problem
from vsacli.documents.csv_file import Header, split_heading
from vsacli.documents.time_column import TIME, UNIT_WORDS_OF_TIMES

REST = "rest"
"""Value of `ignore` that leaves out every unmapped column."""

UNIT_WORDS = {
    **dict.fromkeys(("deg", "degree", "degrees"), "deg"),
    **UNIT_WORDS_OF_TIMES,
    **{word: word for word in ("rev", "mm", "cm")},
    "ma": "mA",
}
"""Lower-case words at the end of a column name that denote a unit other than the SI unit."""

_LAST_WORD = re.compile(r"([A-Za-z]+)[^A-Za-z]*$")
_CAMEL = re.compile(r"[a-z](Deg|Degrees|Degree)$")


@dataclass(frozen=True, kw_only=True)
class MappedColumn:
    """A column of a table, with unit and factor of its numbers.

    Attributes:
        column: heading in the file, or number of the column from 1.
        unit: unit of the numbers; None: the unit in brackets in the header, else that of the target.
        factor: factor by which the numbers are multiplied.
        nanoseconds: for times in whole seconds, the column of the nanoseconds that complete them.
        place: file and line of the declaration.
    """

    column: str | int
    unit: str | None = None
    factor: float = 1.0
    nanoseconds: str | int | None = None
    place: tuple[str, int] = ("", 0)

    def heading(self, target: str, file_heading: str) -> str:
        """Return the heading under which the column is read.

        Args:
            target: name of the quantity in the column.
            file_heading: heading in the file.
        """
        if self.nanoseconds is not None:
            return f"{target} [ns]"
        unit = split_heading(file_heading)[1] if self.unit is None else self.unit
        return target if unit is None else f"{target} [{unit}]"

    def undeclared_unit(self, file_heading: str) -> str | None:
        """Return a unit that the heading in the file suggests but that is not declared; None without one."""
        if (
            self.unit is not None
            or self.nanoseconds is not None
            or split_heading(file_heading)[1] is not None
        ):
            return None
        last_word, camel_word = _LAST_WORD.search(file_heading), _CAMEL.search(file_heading)
        word = camel_word[1] if camel_word else last_word[1] if last_word else ""
        return UNIT_WORDS.get(word.lower())


class ChosenColumns(NamedTuple):
    """Columns of a file to be read.

    Attributes:
        places: positions of the columns, ascending, from 0.
        headings: names in this package, each with its unit in brackets if one is known.
        factors: factors by which their numbers are multiplied.
        unknown_columns: names of unknown columns.
        ignored: names of columns to leave out.
        time: position of the column of stamps, if it is read.
        nanoseconds: position of the column of nanoseconds that completes the stamps, if there is one.
    """

    places: tuple[int, ...]
    headings: tuple[str, ...]
    factors: tuple[float, ...]
    unknown_columns: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    time: int | None = None
    nanoseconds: int | None = None


@dataclass(frozen=True)
class ColumnMapping:
    """A declared mapping of columns.

    Attributes:
        columns: columns of the file, by the names under which they are read.
        ignore: `REST`, or columns to leave out.
        rate: rows per second of a file without times; None if the file has times.
        skip_rows: numbers of lines of the file that are neither header nor rows.
        unwrap: whether to remove jumps by 2 pi from angles.
    """

    columns: Mapping[str, MappedColumn] = field(default_factory=dict)
    ignore: str | tuple[str | int, ...] = ()
    rate: float | None = None
    skip_rows: tuple[int, ...] = ()
    unwrap: bool = False

    def __bool__(self) -> bool:
        return bool(self.columns or self.ignore)

    @property
    def numbers(self) -> tuple[int, ...]:
        """Numbers of the columns if all are declared by number, so that no header is needed; else empty."""
        numbers = tuple(each.column for each in self.columns.values() if isinstance(each.column, int))
        return numbers if len(numbers) == len(self.columns) else ()

    def choose_columns(
        self, header: Header, readable_names: Collection[str] | None, file: str
    ) -> ChosenColumns:
        """Return the columns of a table to read.

        Args:
            header: header of the table.
            readable_names: names of columns to read; all if None.
            file: path for errors.

        Raises:
            InputError: a column is missing, ambiguous, or mapped twice.
        """
        return _ColumnSelection(self, header, readable_names, file).select()

    def combined_with(self, other: ColumnMapping) -> ColumnMapping:
        """Return the combination of two mappings of the same file.

        Raises:
            InputError: the mappings contradict each other.
        """
        for name, source in other.columns.items():
            source_above = self.columns.get(name, source)
            if replace(source_above, place=source.place) != source:
                file, line = source.place
                raise InputError.one(
                    f"columns: {name} is mapped to another column of the same file above", file, line
                )
        ignores_rest = REST in (self.ignore, other.ignore)
        ignore = REST if ignores_rest else tuple(dict.fromkeys((*self.ignore, *other.ignore)))
        skip_rows = tuple(sorted({*self.skip_rows, *other.skip_rows}))
        return ColumnMapping({**self.columns, **other.columns}, ignore, self.rate or other.rate, skip_rows)


AS_NAMED = ColumnMapping()
"""A mapping that reads each column under its own name."""


class _ColumnSelection:
    """Selection of columns from a header, with the problems of the mapping."""

    def __init__(
        self, mapping: ColumnMapping, header: Header, readable_names: Collection[str] | None, file: str
    ) -> None:
        self._mapping, self._header, self._readable_names = mapping, header, readable_names
        self._file = file
        self._problems: list[Problem] = []

    def select(self) -> ChosenColumns:
        mapped_columns = dict(self._assigned_columns())
        nanoseconds = self._find_nanoseconds()
        used_columns = dict(mapped_columns)
        unknown_columns: list[str] = []
        ignored: list[str] = []
        for index, heading in enumerate(self._header.columns):
            if index in mapped_columns or index == nanoseconds:
                continue
            name = split_heading(heading)[0]
            if self._is_ignored(index, heading):
                ignored.append(heading)
            elif self._readable_names is None or name in self._readable_names:
                used_columns[index] = (heading, 1.0)
            else:
                (ignored if self._mapping.ignore == REST else unknown_columns).append(heading)
        self._note_repeated_names(heading for heading, _ in used_columns.values())
        if self._problems:
            raise InputError(self._problems)
        indices = tuple(sorted(used_columns))
        headings = tuple(used_columns[index][0] for index in indices)
        time = next((index for index in indices if split_heading(used_columns[index][0])[0] == TIME), None)
        factors = tuple(used_columns[index][1] for index in indices)
        return ChosenColumns(
            indices, headings, factors, tuple(unknown_columns), tuple(ignored), time, nanoseconds
        )

    def _assigned_columns(self) -> Iterator[tuple[int, tuple[str, float]]]:
        """Yield position, new heading and factor of each mapped column."""
        names_by_index: dict[int, str] = {}
        for name, source in self._mapping.columns.items():
            if self._readable_names is not None and name not in self._readable_names:
                self._note(source, f"unknown name {name!r}{did_you_mean(name, self._readable_names)}")
                continue
            index = self._find_index(source.column, source)
            if index is None:
                continue
            file_heading = self._header.columns[index]
            unit = source.undeclared_unit(file_heading)
            if index in names_by_index:
                self._note(
                    source, f"{file_heading or source.column!r} is already mapped to {names_by_index[index]}"
                )
            elif unit is not None:
                self._note(source, _unit_advice(name, file_heading, unit))
            else:
                names_by_index[index] = name
                yield index, (source.heading(name, file_heading), source.factor)

    def _find_nanoseconds(self) -> int | None:
        source = self._mapping.columns.get(TIME)
        if source is None or source.nanoseconds is None:
            return None
        return self._find_index(source.nanoseconds, source)

    def _find_index(self, column: str | int, source: MappedColumn) -> int | None:
        """Return the position of a column; note a problem and return None if it is missing or ambiguous."""
        names = self._header.columns
        if isinstance(column, int):
            if column <= len(names):
                return column - 1
            self._note(source, f"{self._file} has {len(names)} columns, none with the number {column}")
            return None
        bare_names = [split_heading(heading)[0] for heading in names]
        for candidates in (names, bare_names):
            indices = [place for place, name in enumerate(candidates) if name == column]
            if len(indices) == 1:
                return indices[0]
            if indices:
                numbers = " or ".join(str(place + 1) for place in indices)
                self._note(source, f"{column!r} appears {len(indices)} times; give its number, {numbers}")
                return None
        suggestion = did_you_mean(column, [name for name in names if name])
        self._note(source, f"{self._file} has no column {column!r}{suggestion}")
        return None

    def _is_ignored(self, index: int, heading: str) -> bool:
        ignore = self._mapping.ignore
        return ignore != REST and (
            heading in ignore or split_heading(heading)[0] in ignore or index + 1 in ignore
        )

    def _note_repeated_names(self, headings: Iterable[str]) -> None:
        for name, count in Counter(split_heading(heading)[0] for heading in headings).items():
            source = self._mapping.columns.get(name)
            if count > 1 and source is not None:
                message = (
                    f"{self._file} has a column {name!r} of its own; leave this out, or ignore: [{name}]"
                )
                self._note(source, message)
            elif count > 1:
                message = f"column {name!r} appears {count} times"
                self._problems.append(Problem(self._file, self._header.line, message))

    def _note(self, source: MappedColumn, message: str) -> None:
        self._problems.append(Problem(*source.place, f"columns: {message}"))


def _unit_advice(name: str, file_heading: str, unit: str) -> str:
    mapping_text = f"{name}: {{column: {file_heading!r}, unit: {unit}}}"
    return f"{file_heading!r} speaks of {unit}; if its numbers are, write {mapping_text}, else their unit"
