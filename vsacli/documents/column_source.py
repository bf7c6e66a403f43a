"""What a document says of columns with other people's headers: its keys `columns` and `ignore`."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from vsacli.base.errors import FieldProblem
from vsacli.base.units import DIMENSIONLESS
from vsacli.documents import tree
from vsacli.documents.column_mapping import REST, TIME, MappedColumn
from vsacli.documents.fields import NON_ZERO, check_fields, number, text, value
from vsacli.documents.kinds.nested import read_record
from vsacli.documents.kinds.single import Text
from vsacli.documents.records import Check, JsonOfRecord, Kind, Refer, Schema
from vsacli.documents.tree import INVALID, Node, Scope


class ColumnName(Kind):
    """A column by its name in the header, or by its number."""

    words = "name in the header, or number from 1"

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """A text, or a whole number if it stands without quotes."""
        if isinstance(node, tree.Scalar) and node.plain and node.text.isdecimal():
            return int(node.text)
        return Text().read(node, label, scope)

    def problems(self, path: Any, _check: Check | None, content: Any, /) -> Iterator[FieldProblem]:
        """Number zero."""
        if content == 0:
            yield FieldProblem(path, "columns are counted from 1")

    def schema(self, _check: Check | None, _refer: Refer, /) -> Schema:
        """A string or a whole number."""
        return {"type": ["string", "integer"]}


@dataclass(frozen=True, kw_only=True)
class ColumnSource(MappedColumn):
    """A column of a table, and what its numbers are."""

    column: str | int = value(ColumnName(), "the column")
    unit: str | None = text(
        "unit of its numbers, e.g. deg or ns; by default that in brackets in the header, else that of what it"
        " stands for",
        default=None,
    )
    factor: float = number(
        DIMENSIONLESS,
        "what its numbers are multiplied by, e.g. -1 or 2*pi/4096",
        check=NON_ZERO,
        default=1.0,
    )
    nanoseconds: str | int | None = value(
        ColumnName(), "of `time` in whole seconds: the column of the nanoseconds beside it", default=None
    )

    def __post_init__(self) -> None:
        check_fields(self, *self._problems())

    def _problems(self) -> Iterator[FieldProblem]:
        if self.unit is not None and {"[", "]"} & set(self.unit):
            yield FieldProblem(("unit",), f"is written without brackets, not {self.unit!r}")
        if self.nanoseconds is not None and (self.unit or self.factor != 1):
            yield FieldProblem(("nanoseconds",), "stands beside whole seconds, which need no unit or factor")


class Columns(Kind):
    """A mapping from names that are known here to columns of a table."""

    words = "mapping from names of columns here to columns of the file, each a name, a number or a mapping"

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """`ColumnSource` by name."""
        if not isinstance(node, tree.Mapping) or not node.entries:
            return scope.unexpected(node, "a mapping such as {time: stamp, elbow.q: position}", label)
        found = {name: self._source(entry, f"{label}.{name}", scope) for name, entry in node.entries.items()}
        if INVALID in found.values():
            return INVALID
        return {
            name: dataclasses.replace(source, place=(scope.problems.file, node.key_lines[name]))
            for name, source in found.items()
        }

    def _source(self, node: Node, label: str, scope: Scope) -> Any:
        if isinstance(node, tree.Mapping):
            return read_record(ColumnSource, node, label, scope)
        column = ColumnName().read(node, label, scope)
        if column == 0:
            return scope.unexpected(node, "a column, counted from 1", label)
        return column if column is INVALID else ColumnSource(column=column)

    def problems(self, path: Any, _check: Check | None, content: Any, /) -> Iterator[FieldProblem]:
        """Nothing that its entries have not said, but nanoseconds of what is no time."""
        for name, source in content.items():
            if source.nanoseconds is not None and name != TIME:
                yield FieldProblem((*path, name), f"only {TIME} has nanoseconds beside it")

    def schema(self, _check: Check | None, refer: Refer, /) -> Schema:
        """A mapping of columns."""
        one = {"anyOf": [{"type": ["string", "integer"]}, refer(ColumnSource, None)]}
        return {"type": "object", "minProperties": 1, "additionalProperties": one}

    def json_value(self, content: Any, of_record: JsonOfRecord, /) -> Any:
        """A mapping by name."""
        return {name: of_record(source) for name, source in content.items()}


class Ignored(Kind):
    """Names of columns to leave out, or the word for all that have no use."""

    words = f"`{REST}`, or a list of columns"

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """The word, or a tuple of names."""
        if isinstance(node, tree.Sequence):
            return tree.all_valid([ColumnName().read(item, label, scope) for item in node.items])
        if isinstance(node, tree.Scalar) and node.text == REST:
            return REST
        return scope.unexpected(node, f"{REST} or a list of columns", label)

    def problems(self, _path: Any, _check: Check | None, _content: Any, /) -> Iterator[FieldProblem]:
        """None."""
        return iter(())

    def schema(self, _check: Check | None, _refer: Refer, /) -> Schema:
        """The word, or a list."""
        columns = {"type": "array", "items": {"type": ["string", "integer"]}}
        return {"anyOf": [{"const": REST}, columns]}


def columns_field() -> Any:
    """A field that says what columns stand for."""
    doc = "what columns with other names stand for, e.g. {time: __time, elbow.q: '/joint_states/position[2]'}"
    return value(Columns(), doc, default=None)


def ignore_field() -> Any:
    """A field that says which columns are left out."""
    return value(Ignored(), f"columns to leave out; `{REST}`: all that have no use", default=None)
