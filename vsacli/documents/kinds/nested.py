"""Values that are records: a mapping of declared fields, or one of several kinds of them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from vsacli.base.did_you_mean import did_you_mean, nearest
from vsacli.base.errors import InputError, InvalidRecordError
from vsacli.documents import tree
from vsacli.documents.kinds.single import Choice, unknown_word
from vsacli.documents.records import (
    REQUIRED,
    ArraysOfRecord,
    Check,
    Field,
    FieldPath,
    JsonOfRecord,
    Kind,
    Line,
    LinesOfRecord,
    Refer,
    Schema,
    declared,
)
from vsacli.documents.resolved_fields import ResolvedField, single
from vsacli.documents.tree import INVALID, Node, Scope


@dataclass(eq=False)
class Record(Kind):
    """A mapping read into the record class `cls`."""

    cls: type

    words = "mapping"

    @property
    def records(self) -> Mapping[str, type]:
        """The class."""
        return {"": self.cls}

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """An instance of the class."""
        if isinstance(node, tree.Mapping):
            return read_record(self.cls, node, label, scope)
        return scope.unexpected(node, "a mapping", label)

    def refused(self, name: str, /) -> Iterator[str]:
        """The keys and words in the record that are not supported yet."""
        yield from (f"{name}.{word}" for word in refused_in(self.cls))

    def schema(self, _check: Check | None, refer: Refer, /) -> Schema:
        """A reference to that of the class."""
        return refer(self.cls, None)

    def lines(self, name: str, value: Any, comment: str, of_record: LinesOfRecord, /) -> Iterator[Line]:
        """The key, and farther to the right the fields."""
        yield Line(f"{name}:", comment)
        yield from (line.inside() for line in of_record(self.cls, value))

    def arrays(self, content: Any, of_record: ArraysOfRecord, /) -> Iterator[ResolvedField]:
        """Those of the record."""
        return of_record(content)

    def json_value(self, content: Any, of_record: JsonOfRecord, /) -> Any:
        """A mapping by field."""
        return of_record(content)


def refused_in(cls: type) -> Iterator[str]:
    """Keys and words in a record class that belong to the format but are not supported yet."""
    yield from getattr(cls, "not_yet", ())
    for name, (field, _) in declared(cls).items():
        yield from field.kind.refused(name)


@dataclass(eq=False)
class OneOf(Kind):
    """A mapping whose key `type` selects the record class; `not_yet` as for Choice."""

    variants: Mapping[str, type]
    not_yet: tuple[str, ...] = ()

    @property
    def records(self) -> Mapping[str, type]:
        """The variants."""
        return self.variants

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """An instance of the class that `type` selects."""
        if not isinstance(node, tree.Mapping):
            return scope.unexpected(node, "a mapping with the key 'type'", label)
        selector = node.entries.get("type")
        if selector is None:
            scope.problems.add(node.line, f"{label}: missing key 'type', one of {', '.join(self.variants)}")
            return INVALID
        if not isinstance(selector, tree.Scalar):
            return scope.unexpected(selector, f"one of {', '.join(self.variants)}", f"{label}.type")
        if selector.text not in self.variants:
            reason = unknown_word(selector.text, self.variants, self.not_yet)
            scope.problems.add(selector.line, f"{label}.type: {reason}")
            return INVALID
        return read_record(self.variants[selector.text], node, label, scope, beside=("type",))

    def refused(self, name: str, /) -> Iterator[str]:
        """The variants that are not supported yet."""
        yield from (f"{name}: {{type: {word}}}" for word in self.not_yet)

    def schema(self, _check: Check | None, refer: Refer, /) -> Schema:
        """A mapping of which `type` decides what else it has."""
        return {
            "type": "object",
            "properties": {"type": {"enum": list(self.variants)}},
            "required": ["type"],
            "allOf": [
                {"if": {"properties": {"type": {"const": word}}}, "then": refer(variant, word)}
                for word, variant in self.variants.items()
            ],
        }

    @property
    def words(self) -> str:
        """The variants."""
        return f"mapping; `type`: {' or '.join(f'`{name}`' for name in self.variants)}"

    def lines(self, name: str, value: Any, comment: str, of_record: LinesOfRecord, /) -> Iterator[Line]:
        """The key, and farther to the right the type and the fields."""
        chosen = value["type"]
        others = [word for word in self.variants if word != chosen]
        yield Line(f"{name}:", comment)
        yield Line(f"type: {chosen}", f"or {', '.join(others)}" if others else "").inside()
        yield from (line.inside() for line in of_record(self.variants[chosen], value))

    def arrays(self, content: Any, of_record: ArraysOfRecord, /) -> Iterator[ResolvedField]:
        """The type and those of the record."""
        yield single((), None, self._word(content))._replace(path=("type",))
        yield from of_record(content)

    def json_value(self, content: Any, of_record: JsonOfRecord, /) -> Any:
        """A mapping that begins with the type."""
        return {"type": self._word(content), **of_record(content)}

    def _word(self, record: Any) -> str:
        return next(word for word, variant in self.variants.items() if type(record) is variant)


def read_record(cls: type, node: tree.Mapping, label: str, scope: Scope, beside: tuple[str, ...] = ()) -> Any:
    """Read a mapping into a record class; the keys `beside` those of the class are the caller's."""
    prefix = f"{label}: " if label else ""
    scope = scope_inside(scope, cls, node)
    fields = declared(cls)
    mistyped = _refuse_unknown_keys(cls, node, (*fields, *beside), scope)
    values = {
        name: _read_field(name, field, node, prefix, scope)
        for name, (field, default) in fields.items()
        if name in node.entries or (default is REQUIRED and name not in mistyped)
    }
    if INVALID in values.values() or not mistyped.isdisjoint(fields):
        return INVALID
    try:
        return cls(**values)
    except InvalidRecordError as error:
        for problem in error.fields:
            message = problem.in_file(list(scope.members))
            scope.problems.add(line_of(problem.path, node, scope), f"{prefix}{message}")
        return INVALID
    except InputError as error:
        scope.problems.include(error)
        return INVALID


def scope_inside(scope: Scope, cls: type, node: tree.Mapping) -> Scope:
    """The scope of the values in a record."""
    key, variant = getattr(cls, "unit_variant_with", (None, None))
    if key in node.entries:
        return scope._replace(variant=variant)
    selector = getattr(cls, "unit_variant", None)
    if selector is None:
        return scope
    match declared(cls)[selector][0].kind, node.entries.get(selector):
        case Choice(options=options), tree.Scalar(text=word) if word in options:
            return scope._replace(variant=word)
    return scope._replace(variant=None)


def _refuse_unknown_keys(cls: type, node: tree.Mapping, known: Collection[str], scope: Scope) -> set[str]:
    """Note unknown keys; returns the known ones that were probably meant, which are then not missing."""
    meant: set[str] = set()
    for key, line in node.key_lines.items():
        if key in getattr(cls, "not_yet", ()):
            scope.problems.add(line, f"{key!r} is not supported yet")
        elif key not in known:
            scope.problems.add(line, f"unknown key {tree.quoted(key)}{did_you_mean(key, known)}")
            meant.update(filter(None, [nearest(key, known)]))
    return meant - node.entries.keys()


def _read_field(name: str, field: Field, node: tree.Mapping, prefix: str, scope: Scope) -> Any:
    content = node.entries.get(name)
    if content is None:
        scope.problems.add(node.line, f"{prefix}missing key {name!r} ({field.doc})")
        return INVALID
    value = field.kind.read(content, name, scope)
    if value is INVALID:
        return INVALID
    problems = list(field.problems(name, value))
    for problem in problems:
        place = f" of joint {list(scope.members)[int(problem.path[-1])]}" if field.kind.per_joint else ""
        scope.problems.add(line_of(problem.path, node, scope), f"{name}{place}: {problem.message}")
    return INVALID if problems else value


def line_of(path: FieldPath, node: Node, scope: Scope) -> int:
    """The line of the deepest node on the way along a path; a scalar stands for all entries of its value."""
    for step in path:
        if isinstance(node, tree.Mapping):
            key = list(scope.members)[step] if isinstance(step, int) else step
            if key not in node.entries:
                break
            node = node.entries[key]
        elif isinstance(node, tree.Sequence) and isinstance(step, int):
            node = node.items[step]
    return node.line
