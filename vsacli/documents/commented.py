"""YAML documents with a comment on every declared key; optional keys are commented out."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Collection, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

from vsacli.base.texts import on_one_line
from vsacli.base.units import DIMENSIONLESS
from vsacli.documents.fields import (
    REQUIRED,
    Field,
    Interval,
    Items,
    ItemsByName,
    OneOf,
    OwnKind,
    PairOf,
    RecordOf,
    ValueKind,
    WordChoice,
    declared_fields,
    variant_inside,
)

Values: TypeAlias = Mapping[str, Any]
"""Values to write, by key: numbers, texts, lists of these, and nested mappings for records."""

COMMENT_COLUMN = 44
WIDTH = 110


class _YamlLine(NamedTuple):
    """A line: its text, a comment on it, and whether it is active or commented out."""

    text: str
    comment: str = ""
    active: bool = True

    def inside(self, indent: str = "  ") -> _YamlLine:
        return self._replace(text=indent + self.text)


def commented_document(
    format_name: str,
    cls: type,
    values: Values,
    head: Iterable[str] = (),
    sources: Mapping[str, str] = MappingProxyType({}),
    unmentioned: Collection[str] = (),
) -> str:
    """Return a document of the record class `cls`.

    Args:
        format_name: value of the key `format`.
        cls: record class of the whole document.
        values: values of every required field, and of the optional fields to set.
        head: lines of the comment at the top.
        sources: where a reader finds the value of a field, by `Class.field`; each text is said once.
        unmentioned: fields that do not stand in comments either.
    """
    lines = [_YamlLine(f"format: {format_name}"), *_Commented(sources, unmentioned).record(cls, values, "")]
    comments = [f"# {line}".rstrip() for line in head]
    return "\n".join([*comments, *(text for line in lines for text in _wrap_comment(line))]) + "\n"


def three_digits(value: float) -> float:
    """Return a number rounded for a file to begin with."""
    return float(f"{value:.3g}")


def _wrap_comment(line: _YamlLine) -> Iterator[str]:
    """Yield a line and its wrapped comment, next to it or, if the line is long, before it."""
    text = line.text if line.active else f"# {line.text}"
    comments = [f"# {part}" for part in textwrap.wrap(line.comment, WIDTH - COMMENT_COLUMN - 2)]
    if len(text) < COMMENT_COLUMN and comments:
        text = f"{text:<{COMMENT_COLUMN}}{comments.pop(0)}"
        yield text
        yield from (f"{'':<{COMMENT_COLUMN}}{comment}" for comment in comments)
    else:
        yield from (f"{'':<{COMMENT_COLUMN}}{comment}" for comment in comments)
        yield text


class _Commented:
    """Lines of records. Of a list of records the first has all keys; the others explain only what is new.

    Args:
        sources: where a reader finds the value of a field, by `Class.field`.
        unmentioned: fields that are left out without a value.
    """

    def __init__(self, sources: Mapping[str, str], unmentioned: Collection[str]) -> None:
        self._sources, self._unmentioned = sources, unmentioned
        self._stated_sources: set[str] = set()
        self._explained: set[tuple[type, str]] = set()
        self._in_later_entry = False

    def record(self, cls: type, values: Values, variant: str) -> Iterator[_YamlLine]:
        """Yield all fields of a record; fields without a value are inactive and show their defaults."""
        variant = variant_inside(cls, values.get(getattr(cls, "unit_variant", "")), variant) or variant
        for name, (field, default) in declared_fields(cls).items():
            explained_before = self._in_later_entry and (cls, name) in self._explained
            self._explained.add((cls, name))
            comment = "" if explained_before else self._comment(cls, name, field, variant)
            if name in values:
                yield from self._field_with_value(field.kind, name, values[name], comment, variant)
            elif default is REQUIRED:
                raise KeyError(f"{cls.__name__} needs a value of {name}")
            elif not explained_before and name not in self._unmentioned:
                yield from self._field_without_value(field, name, default, comment, variant)

    def _field_with_value(
        self, kind: ValueKind, name: str, value: Any, comment: str, variant: str
    ) -> Iterator[_YamlLine]:
        """Yield a field with a value, in one line if all inside is explained already."""
        first_line, *inner_lines = self._field(kind, name, value, comment, variant)
        if (
            inner_lines
            and self._in_later_entry
            and all(line.active and not line.comment for line in inner_lines)
        ):
            yield _YamlLine(f"{name}: {on_one_line(value)}", comment)
        else:
            yield first_line
            yield from inner_lines

    def _field_without_value(
        self, field: Field, name: str, default: Any, comment: str, variant: str
    ) -> Iterator[_YamlLine]:
        """Yield a field without a value, inactive; of a record its example."""
        if isinstance(field.kind, ItemsByName) and "" in field.kind.records:
            entry = dict(field.kind.records[""].example(variant))  # type: ignore[attr-defined]
            by_name = {entry.pop(field.kind.unique): entry}
            yield _YamlLine(f"{name}: {on_one_line(by_name)}", comment, active=False)
            return
        if not isinstance(field.kind, RecordOf):
            yield _YamlLine(f"{name}: {_format_default(default)}".rstrip(), comment, active=False)
            return
        example: Values = {} if default is not None else field.kind.records[""].example(variant)  # type: ignore[attr-defined]
        lines = self._field_with_value(field.kind, name, example, comment, variant)
        yield from (line._replace(active=False) for line in lines)

    def _field(
        self, kind: ValueKind, name: str, value: Any, comment: str, variant: str
    ) -> Iterator[_YamlLine]:
        """Yield a field for a value in the form used in files; nested fields are indented."""
        match kind:
            case PairOf() if isinstance(value, list):
                yield _YamlLine(f"{name}:", comment)
                yield from (_YamlLine(f"- {on_one_line(entry)}").inside() for entry in value)
            case PairOf(item):
                yield from self._field(item, name, value, comment, variant)
            case RecordOf(cls):
                yield _YamlLine(f"{name}:", comment)
                yield from (line.inside() for line in self.record(cls, value, variant))
            case OneOf(variants):
                chosen_type = value["type"]
                other_types = ", ".join(word for word in variants if word != chosen_type)
                yield _YamlLine(f"{name}:", comment)
                yield _YamlLine(
                    f"type: {chosen_type}", f"or {other_types}" if other_types and comment else ""
                ).inside()
                yield from (line.inside() for line in self.record(variants[chosen_type], value, variant))
            case Items() if kind.records or isinstance(value[0], list):
                yield _YamlLine(f"{name}:", comment)
                yield from self._entries(kind, value, variant)
            case OwnKind() if all(isinstance(entry, Mapping | list) for entry in value.values()):
                yield _YamlLine(f"{name}:", comment)
                yield from (
                    _YamlLine(f"{key}: {on_one_line(entry)}").inside() for key, entry in value.items()
                )
            case _:
                yield _YamlLine(f"{name}: {on_one_line(value)}", comment)

    def _entries(self, kind: Items, values: Any, variant: str) -> Iterator[_YamlLine]:
        """Yield lists as one line each, and the keys of records."""
        if not kind.records:
            yield from (_YamlLine(f"- {on_one_line(entry)}").inside() for entry in values)
            return
        was_in_later_entry = self._in_later_entry
        for value in values:
            first_line, *other_lines = self.record(kind.records[""], value, variant)
            yield first_line.inside("- ").inside()
            yield from (line.inside().inside() for line in other_lines)
            self._in_later_entry = True
        self._in_later_entry = was_in_later_entry

    def _comment(self, cls: type, name: str, field: Field, variant: str) -> str:
        """Return unit and meaning of a field, its forms where they are not obvious, and its source."""
        unit = field.quantity.unit(variant) if variant else str(field.quantity)
        match field.kind:
            case WordChoice(options=options):
                forms = f" ({' or '.join(options)})"
            case Interval():
                forms = " ([lower, upper] or one number)"
            case _:
                forms = ""
        meaning = f"{field.doc}{forms}" if unit == str(DIMENSIONLESS) else f"{unit}; {field.doc}{forms}"
        source = self._sources.get(f"{cls.__name__}.{name}", "")
        if not source or source in self._stated_sources:
            return meaning
        self._stated_sources.add(source)
        return f"{meaning}. {source}"


def _format_default(default: Any) -> str:
    """Return a default in the form used in files; empty if it has none."""
    numbers = default if isinstance(default, tuple) else (default,)
    if all(isinstance(number, int | float) and math.isfinite(number) for number in numbers):
        return on_one_line(default)
    return default if isinstance(default, str) else ""
