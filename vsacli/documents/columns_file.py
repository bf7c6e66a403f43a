"""The keys `columns` and `ignore` of documents, which map columns with foreign names.

The keys are used in trajectory files, and in files for recordings alone, `vsacli-columns/1`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from vsacli.base import file_formats
from vsacli.base.errors import FieldProblem, InputError
from vsacli.base.units import DIMENSIONLESS, RATE
from vsacli.documents.column_mapping import AS_NAMED, REST, ColumnMapping, MappedColumn
from vsacli.documents.expression import ExpressionError
from vsacli.documents.fields import (
    LARGEST,
    NON_ZERO,
    POSITIVE,
    FieldPath,
    Integer,
    Items,
    OwnKind,
    Refer,
    Schema,
    boolean,
    number,
    text,
    value,
)
from vsacli.documents.number import evaluate
from vsacli.documents.reading import read_document
from vsacli.documents.record_checks import DeclaredRecord, construct_unchecked
from vsacli.documents.record_reader import read_record, read_text
from vsacli.documents.time_column import TIME
from vsacli.documents.tree import INVALID, ListNode, MapNode, Node, Scope, TextNode, all_valid


class ColumnName(OwnKind):
    """A column by its name in the header, or by its number."""

    words = "name in the header, or number from 1"

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return a text, or an integer if the node is a whole number without quotes."""
        if isinstance(node, TextNode) and node.plain and node.text.isdecimal():
            return int(node.text)
        return read_text(self, node, label, scope)

    def problems(self, path: FieldPath, content: Any) -> Iterator[FieldProblem]:
        """See `OwnKind.problems`."""
        if content == 0:
            yield FieldProblem(path, "columns are counted from 1")

    def schema(self, _refer: Refer) -> Schema:
        """See `OwnKind.schema`."""
        return {"type": ["string", "integer"]}


@dataclass(frozen=True, kw_only=True)
class ColumnSource(DeclaredRecord, MappedColumn):
    """A column of a table, with unit and factor of its numbers."""

    column: str | int = value(ColumnName(), "name or number of the column")
    unit: str | None = text(
        "unit of the values, e.g. deg or ns; by default the unit in brackets in the header, else "
        "the unit of the signal",
        default=None,
    )
    factor: float = number(
        DIMENSIONLESS,
        "factor by which the values are multiplied, e.g. -1 or 2*pi/4096",
        check=NON_ZERO,
        default=1.0,
    )
    nanoseconds: str | int | None = value(
        ColumnName(), "column of nanoseconds that is added to a `time` in whole seconds", default=None
    )

    def _problems(self) -> Iterator[FieldProblem]:
        if self.unit is not None and {"[", "]"} & set(self.unit):
            yield FieldProblem(("unit",), f"is written without brackets, not {self.unit!r}")
        if self.nanoseconds is not None and (self.unit or self.factor != 1):
            yield FieldProblem(("nanoseconds",), "requires whole seconds, without unit or factor")


class Columns(OwnKind):
    """A mapping from names of this package to columns of a table."""

    words = "mapping from names of columns here to columns of the file, each a name, a number or a mapping"

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return `ColumnSource` records by name."""
        if not isinstance(node, MapNode) or not node.entries:
            return scope.unexpected(node, "a mapping such as {time: stamp, elbow.q: position}", label)
        sources = {
            name: self._source(entry, f"{label}.{name}", scope) for name, entry in node.entries.items()
        }
        if INVALID in sources.values():
            return INVALID
        return {
            name: construct_unchecked(
                ColumnSource, {**vars(source), "place": (scope.problems.file, node.key_lines[name])}
            )
            for name, source in sources.items()
        }

    def _source(self, node: Node, label: str, scope: Scope) -> Any:
        if isinstance(node, MapNode):
            return read_record(ColumnSource, node, label, scope)
        column = ColumnName().read(node, label, scope)
        if column == 0:
            return scope.unexpected(node, "a column, counted from 1", label)
        return column if column is INVALID else ColumnSource(column=column)

    def problems(self, path: FieldPath, content: Any) -> Iterator[FieldProblem]:
        """See `OwnKind.problems`; each entry has been checked on construction."""
        for name, source in content.items():
            if source.nanoseconds is not None and name != TIME:
                yield FieldProblem((*path, name), f"only {TIME} may have a column of nanoseconds")

    def schema(self, refer: Refer) -> Schema:
        """See `OwnKind.schema`."""
        column_schema = {"anyOf": [{"type": ["string", "integer"]}, refer(ColumnSource, None)]}
        return {"type": "object", "minProperties": 1, "additionalProperties": column_schema}

    def json_value(self, content: Any, of_record: Callable[[Any], Any]) -> Any:
        """See `OwnKind.json_value`."""
        return {name: of_record(source) for name, source in content.items()}


class Ignored(OwnKind):
    """Names of columns to leave out, or the word for all unknown columns."""

    words = f"`{REST}`, or a list of columns"

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the word `REST`, or a tuple of names."""
        if isinstance(node, ListNode):
            return all_valid([ColumnName().read(item, label, scope) for item in node.items])
        if isinstance(node, TextNode) and node.text == REST:
            return REST
        return scope.unexpected(node, f"{REST} or a list of columns", label)

    def schema(self, _refer: Refer) -> Schema:
        """See `OwnKind.schema`."""
        columns = {"type": "array", "items": {"type": ["string", "integer"]}}
        return {"anyOf": [{"const": REST}, columns]}


def columns_field() -> Any:
    """Declare a field that maps columns."""
    doc = (
        "mapping from signals to columns with other names, e.g. {time: __time, elbow.q: "
        "'/joint_states/position[2]'}"
    )
    return value(Columns(), doc, default=None)


def ignore_field() -> Any:
    """Declare a field for columns to leave out."""
    return value(Ignored(), f"columns to ignore; `{REST}`: all columns that are not used", default=None)


def skip_rows_field() -> Any:
    """Declare a field for lines that are neither header nor rows."""
    doc = "line numbers of a preamble above the header, or of a row of units below it, to leave out"
    return value(Items(Integer()), doc, check=POSITIVE, default=None)


@dataclass(frozen=True, kw_only=True)
class ColumnsFile(DeclaredRecord):
    """The content of a columns file: the keys of a trajectory file that concern its recordings."""

    columns: Mapping[str, MappedColumn] | None = columns_field()
    ignore: str | tuple[str | int, ...] | None = ignore_field()
    skip_rows: tuple[int, ...] | None = skip_rows_field()
    rate: float | None = number(
        RATE, "sampling rate of recordings without a time column", check=POSITIVE, default=None
    )

    unwrap: bool = boolean(
        "remove jumps by 2 pi from the angles of revolute joints and their motors", default=False
    )

    def _problems(self) -> Iterator[FieldProblem]:
        if not (self.columns or self.ignore or self.skip_rows or self.rate or self.unwrap):
            yield FieldProblem((), "says nothing: give columns, ignore, skip_rows, rate or unwrap")


def load_columns(path: str | os.PathLike[str] | None) -> ColumnMapping:
    """Return the mapping of a file; without a file, the mapping that reads each column under its own name.

    Raises:
        InputError: with every problem of the file, each with its line.
    """
    if path is None:
        return AS_NAMED
    document, _ = read_document(path, ColumnsFile, file_formats.COLUMNS)
    return ColumnMapping(
        document.columns or {},
        document.ignore or (),
        document.rate,
        document.skip_rows or (),
        document.unwrap,
    )


def parse_rate(rate_or_text: Any) -> float:
    """Return rows per second, given as a number or as a text in the form used in files.

    Raises:
        InputError: the rate is not a positive number.
    """
    try:
        rate = evaluate(rate_or_text, "1/s") if isinstance(rate_or_text, str) else float(rate_or_text)
    except (ExpressionError, TypeError, ValueError):
        rate = math.nan
    if not 0 < rate <= LARGEST:
        rate_text = f"{rate_or_text:g}" if isinstance(rate_or_text, float) else rate_or_text
        raise InputError.one(f"rate: must be a positive number of samples per second, not {rate_text}")
    return rate
