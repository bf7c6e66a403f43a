"""Records from the rows of a CSV table with one column for each declared field, texts included."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from io import BytesIO
from typing import Any, Generic, NamedTuple, TypeVar

from vsacli.base.did_you_mean import nearest
from vsacli.base.errors import InputError
from vsacli.documents.csv_file import (
    HEADER,
    Header,
    filled_lines,
    header_of,
    split_cells,
    split_heading,
    wrong_count,
)
from vsacli.documents.expression import conversion_factor
from vsacli.documents.fields import REQUIRED, NumberWithUnit, ValueKind, declared_fields
from vsacli.documents.record_checks import DeclaredRecord
from vsacli.documents.record_reader import read_record
from vsacli.documents.source import Problems, Source, read_source
from vsacli.documents.tree import INVALID, MapNode, Scope, TextNode, quoted

MAX_BYTES = 50_000_000
"""Largest file in bytes; rows become objects, and a hundred thousand rows have some ten million bytes."""

_Record = TypeVar("_Record", bound=DeclaredRecord)


class RecordTable(NamedTuple, Generic[_Record]):
    """A table read as records.

    Attributes:
        records: one record a row.
        lines: line numbers of the rows in the file.
        unknown_columns: names of columns without a field, which were not read.
        source: file that was read.
    """

    records: tuple[_Record, ...]
    lines: tuple[int, ...]
    unknown_columns: tuple[str, ...]
    source: Source


class _ColumnsByField(NamedTuple):
    """The columns of a table, assigned to fields.

    Attributes:
        width: number of columns.
        places: index of the column of each field that has one.
        factors: factors that convert the numbers of a field to SI units.
        units: units of the numbers of a field, as written and SI, where they differ.
        unknown_columns: names of columns without a field.
    """

    width: int
    places: dict[str, int]
    factors: dict[str, float]
    units: dict[str, tuple[str, str]]
    unknown_columns: list[str]


def read_records(path: str | os.PathLike[str], cls: type[_Record], unique: str) -> RecordTable[_Record]:
    """Read a CSV file into records.

    The first line names the columns: fields in any order, numbers in other than SI units with their unit in
    brackets. A tab, semicolon or comma in it is the separator, else blanks. Cells may be in double quotes; an
    empty cell leaves a field at its default. Comments go from `#` to the end of a line.

    Args:
        path: path of the file, UTF-8.
        cls: record class.
        unique: name of the field that must differ in all records.

    Raises:
        InputError: with file and line of every problem.
    """
    source, text = read_source(path, MAX_BYTES, HEADER)
    problems = Problems(source.path)
    header = header_of(BytesIO(text.encode()), source.path)
    columns = _assign_columns(header, cls, problems)
    problems.check()
    records: dict[int, _Record] = {}
    first: dict[Any, int] = {}
    for number, content in filled_lines(text.splitlines(), header):
        cells = [cell.strip() for cell in split_cells(content, header.separator)]
        if not any(cells):
            continue
        record = _read_row(cells, columns, cls, Scope(problems, {}, {}), number)
        if record is not None:
            records[number] = record
            key = getattr(record, unique)
            if first.setdefault(key, number) != number:
                problems.add(number, f"the {unique} {quoted(key)} is already used in line {first[key]}")
    problems.check()
    if not records:
        raise InputError.one("has a header but no rows of values", source.path)
    return RecordTable(tuple(records.values()), tuple(records), tuple(columns.unknown_columns), source)


def _assign_columns(header: Header, cls: type, problems: Problems) -> _ColumnsByField:
    """Return the columns of a header by field; refuse an unknown name that is close to a field's."""
    fields = declared_fields(cls)
    columns = _ColumnsByField(len(header.columns), {}, {}, {}, [])
    meant = set()
    for index, (name, unit) in enumerate(map(split_heading, header.columns)):
        if name in columns.places:
            problems.add(header.line, f"column {name!r} appears more than once")
        elif name in fields:
            columns.places[name] = index
            columns.factors[name] = _factor_to_si(name, unit, fields[name][0].kind, header.line, problems)
            if columns.factors[name] != 1 and unit is not None:
                columns.units[name] = unit, fields[name][0].quantity.revolute
        else:
            columns.unknown_columns.append(name)
            near = nearest(name, fields)
            if near is not None:
                problems.add(header.line, f"unknown column {quoted(name)}; did you mean {near!r}?")
                meant.add(near)
    missing = [
        f"{name!r} ({field.doc})"
        for name, (field, default) in fields.items()
        if default is REQUIRED and name not in columns.places and name not in meant
    ]
    if missing:
        problems.add(
            header.line, f"missing {'column' if len(missing) == 1 else 'columns'} {', '.join(missing)}"
        )
    return columns


def _factor_to_si(name: str, unit: str | None, kind: ValueKind, line: int, problems: Problems) -> float:
    if unit is None:
        return 1.0
    try:
        if not isinstance(kind, NumberWithUnit):
            raise InputError.one("holds texts, which have no unit")
        return 1.0 if unit == kind.unit.revolute else conversion_factor(unit, kind.unit.revolute)
    except InputError as error:
        problems.add(line, f"column {name!r}: {error}")
        return math.nan


def _read_row(
    cells: Sequence[str], columns: _ColumnsByField, cls: type[_Record], scope: Scope, line: int
) -> _Record | None:
    """Return the record of a row; None if its problems were noted."""
    if len(cells) != columns.width:
        hint = "; names with the separator in them go in double quotes" if len(cells) > columns.width else ""
        scope.problems.add(line, f"{wrong_count(columns.width, len(cells))}{hint}")
        return None
    cell_nodes = {
        field: TextNode(line, _in_si(cells[index], columns.factors[field]), plain=False)
        for field, index in columns.places.items()
        if cells[index]
    }
    missing = [
        name
        for name, (_, default) in declared_fields(cls).items()
        if default is REQUIRED and name not in cell_nodes
    ]
    for name in missing:
        scope.problems.add(line, f"column {name!r} is empty")
    if missing:
        return None
    problems = Problems(scope.problems.file)
    mapping = MapNode(line, cell_nodes, dict.fromkeys(cell_nodes, line))
    record = read_record(cls, mapping, "", scope._replace(problems=problems))
    try:
        problems.check()
    except InputError as error:
        for problem in error.problems:
            scope.problems.add(line, _in_file_units(problem.message, cells, columns))
    return None if record is INVALID else record


def _in_file_units(message: str, cells: Sequence[str], columns: _ColumnsByField) -> str:
    """Return a message about a converted number with the number and unit of the file."""
    field = message.partition(":")[0]
    if field not in columns.units:
        return message
    cell, (written, expected) = cells[columns.places[field]], columns.units[field]
    try:
        converted = f"{float(_in_si(cell, columns.factors[field])):g} {expected}"
    except ValueError:  # a text, which was not converted
        return message
    return message.replace(converted, f"{cell} {written}")


def _in_si(cell: str, factor: float) -> str:
    """Return the text of a number, converted; other texts stay as they are, for their reader to report."""
    if factor == 1:
        return cell
    try:
        return repr(float(cell) * factor)
    except ValueError:
        return cell
