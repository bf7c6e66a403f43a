"""Values that are several of one kind: a list, or a pair of sides."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from vsacli.base.errors import FieldProblem
from vsacli.base.units import DIMENSIONLESS, Quantity
from vsacli.documents import tree
from vsacli.documents.kinds.nested import line_of
from vsacli.documents.kinds.vectors import list_of
from vsacli.documents.records import (
    ArraysOfRecord,
    Check,
    FieldPath,
    JsonOfRecord,
    Kind,
    Line,
    LinesOfRecord,
    Refer,
    Schema,
    declared,
    on_one_line,
)
from vsacli.documents.resolved_fields import ResolvedField, stacked
from vsacli.documents.tree import INVALID, Node, Scope, all_valid, quoted


class _Entries(Kind):
    """Several values of one kind."""

    item: Kind

    @property
    def each(self) -> Kind:
        """The kind of the entries."""
        return self.item

    @property
    def records(self) -> Mapping[str, type]:
        """Those of an entry."""
        return self.item.records

    def refused(self, name: str, /) -> Iterator[str]:
        """As of an entry."""
        return self.item.refused(name)

    def json_value(self, content: Any, of_record: JsonOfRecord, /) -> Any:
        """A list of the entries."""
        return [self.item.json_value(entry, of_record) for entry in content]


@dataclass(eq=False)
class Items(_Entries):
    """A list of one or more values of a kind, read as a tuple; all differ in the text field `unique`."""

    item: Kind
    unique: str | None = None

    marks = "[]"

    @property
    def per_joint(self) -> bool:
        """As of an entry."""
        return self.item.per_joint

    def names(self, content: Any, _members: Mapping[str, str], /) -> list[str]:
        """The names that the entries have."""
        return [getattr(entry, "name", "") for entry in content]

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """The entries, all different."""
        if not isinstance(node, tree.Sequence) or not node.items:
            return scope.unexpected(node, "a list of one or more", label)
        values = all_valid([self.item.read(item, label, scope) for item in node.items])
        return INVALID if self._note_repeated(node, label, scope) else values

    def _note_repeated(self, node: tree.Sequence, label: str, scope: Scope) -> bool:
        if self.unique is None:
            return False
        keys = [_scalar_entry(item, self.unique) for item in node.items]
        found = list(_repeated(key.text if key else None for key in keys))
        for index, message in found:
            line = line_of((index, self.unique), node, scope)
            scope.problems.add(line, f"{label}.{self.unique}: {message}")
        return bool(found)

    def problems(self, path: FieldPath, check: Check | None, content: Any, /) -> Iterator[FieldProblem]:
        """Entries that are alike, or what is wrong with one of them."""
        if self.unique is not None:
            for index, message in _repeated(getattr(item, self.unique) for item in content):
                yield FieldProblem((*path, index, self.unique), message)
        else:
            for index, item in enumerate(content):
                yield from self.item.problems((*path, index), check, item)

    def schema(self, check: Check | None, refer: Refer, /) -> Schema:
        """A list that is not empty."""
        return {"type": "array", "minItems": 1, "items": self.item.schema(check, refer)}

    @property
    def words(self) -> str:
        """A list, and of what, if that is not shown apart."""
        return "list" if self.records else f"list, each {self.item.words}"

    def lines(self, name: str, value: Any, comment: str, of_record: LinesOfRecord, /) -> Iterator[Line]:
        """Of records the first with all its keys and comments, the others with what is set; a list a line."""
        if not self.records and not isinstance(value[0], list):
            yield from super().lines(name, value, comment, of_record)
            return
        yield Line(f"{name}:", comment)
        if not self.records:
            yield from (Line(f"- {on_one_line(entry)}").inside() for entry in value)
            return
        first, *others = value
        entries = [list(of_record(self.records[""], first))]
        entries += [[Line(f"{key}: {on_one_line(each)}") for key, each in other.items()] for other in others]
        for head, *rest in entries:
            yield head.inside("- ").inside()
            yield from (line.inside().inside() for line in rest)

    def arrays(self, content: Any, of_record: ArraysOfRecord, /) -> Iterator[ResolvedField]:
        """Those of all joints."""
        if not self.records:
            return super().arrays(content, of_record)
        return stacked("joint", (self.item.arrays(joint, of_record) for joint in content))


def _repeated(words: Iterable[str | None]) -> Iterator[tuple[int, str]]:
    """Index of, and message about, each word that stood before; None never counts."""
    seen: set[str] = set()
    for index, word in enumerate(words):
        if word is not None and word in seen:
            yield index, f"{quoted(word)} is taken by another entry; each needs its own"
        elif word is not None:
            seen.add(word)


def _scalar_entry(node: Node, key: str) -> tree.Scalar | None:
    entry = node.entries.get(key) if isinstance(node, tree.Mapping) else None
    return entry if isinstance(entry, tree.Scalar) else None


@dataclass(eq=False)
class Pair(_Entries):
    """One value for both of two, the sides of a joint say, or a list of two, read as a pair.

    `dim` is what the arrays of both lie along.
    """

    item: Kind
    dim: str = "motor"

    @property
    def unit(self) -> Quantity:
        """What one measures."""
        unit: Quantity = getattr(self.item, "unit", DIMENSIONLESS)
        return unit

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Both values, which are one if one was written."""
        if isinstance(node, tree.Mapping) and self._names_sides(node):
            keys = ", ".join(map(quoted, node.entries))
            expected = "one mapping for both sides or a list of two"
            scope.problems.add(node.line, f"{label}: expected {expected}, found the keys {keys}")
            return INVALID
        if not isinstance(node, tree.Sequence):
            both = self.item.read(node, label, scope)
            return both if both is INVALID else (both, both)
        if len(node.items) != 2:
            return scope.unexpected(node, "one value for both sides or a list of 2", label)
        return all_valid([self.item.read(item, label, scope) for item in node.items])

    def _names_sides(self, node: tree.Mapping) -> bool:
        """Whether mappings stand under keys of their own, as in `{flexor: {...}, extensor: {...}}`."""
        if not node.entries or not all(isinstance(value, tree.Mapping) for value in node.entries.values()):
            return False
        known = {"type", *(name for cls in self.records.values() for name in declared(cls))}
        return known.isdisjoint(node.entries)

    def problems(self, path: FieldPath, check: Check | None, content: Any, /) -> Iterator[FieldProblem]:
        """What is wrong with one of them."""
        for index, item in enumerate(content):
            yield from self.item.problems((*path, index), check, item)

    def schema(self, check: Check | None, refer: Refer, /) -> Schema:
        """One, or a list of two."""
        item = self.item.schema(check, refer)
        return {"if": {"type": "array"}, "then": list_of(item, 2), "else": item}

    @property
    def words(self) -> str:
        """What one is."""
        return f"{self.item.words}; or a list of two"

    def lines(self, name: str, value: Any, comment: str, of_record: LinesOfRecord, /) -> Iterator[Line]:
        """One for both sides."""
        return self.item.lines(name, value, comment, of_record)

    def arrays(self, content: Any, of_record: ArraysOfRecord, /) -> Iterator[ResolvedField]:
        """Those of both."""
        return stacked(self.dim, (self.item.arrays(side, of_record) for side in content))
