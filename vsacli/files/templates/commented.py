"""A YAML document with a comment on every key that is declared; optional ones stand commented out."""

from __future__ import annotations

import dataclasses
import math
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from vsacli.base.units import DIMENSIONLESS, Quantity
from vsacli.documents.fields import (
    REQUIRED,
    Choice,
    Field,
    Interval,
    Items,
    Kind,
    OneOf,
    Pair,
    Record,
    declared,
)

COMMENT_COLUMN = 44
WIDTH = 110
INDENT = "  "

Values: TypeAlias = Mapping[str, Any]
"""Values to be written, by key: numbers, texts, lists of them, and such mappings for records."""


@dataclass(frozen=True)
class Line:
    """A line of a document: its text with indentation, a comment on it, and whether a reader sees it."""

    text: str
    comment: str = ""
    active: bool = True

    def inside(self, indent: str = INDENT) -> Line:
        """The line, farther to the right."""
        return dataclasses.replace(self, text=indent + self.text)

    def render(self) -> Iterator[str]:
        """The line and its comment, beside it or, if it is long, before it, on as many lines as it takes."""
        text = self.text if self.active else f"# {self.text}"
        comments = [f"# {part}" for part in textwrap.wrap(self.comment, WIDTH - COMMENT_COLUMN - 2)]
        if len(text) < COMMENT_COLUMN and comments:
            text = f"{text:<{COMMENT_COLUMN}}{comments.pop(0)}"
            yield text
            yield from (f"{'':<{COMMENT_COLUMN}}{comment}" for comment in comments)
        else:
            yield from (f"{'':<{COMMENT_COLUMN}}{comment}" for comment in comments)
            yield text


def document(format_name: str, cls: type, values: Values, head: Iterable[str] = ()) -> str:
    """A document of the record class `cls`.

    Args:
        format_name: what its key `format` says.
        cls: the record class of the whole document.
        values: of every required field, and of the optional ones that shall be set.
        head: lines of comment before it.
    """
    lines = [Line(f"format: {format_name}"), *_record(cls, values)]
    comments = [f"# {line}".rstrip() for line in head]
    return "\n".join([*comments, *(text for line in lines for text in line.render())]) + "\n"


def _record(cls: type, values: Values, variant: str = "") -> Iterator[Line]:
    """All fields of a record."""
    variant = str(values.get(getattr(cls, "unit_variant", ""), variant))
    for name, (field, default) in declared(cls).items():
        if name in values:
            yield from _active(name, field, values[name], variant)
        elif default is REQUIRED:
            raise KeyError(f"{cls.__name__} needs a value of {name}")
        else:
            shown = _inactive(name, field, default, variant)
            yield from (dataclasses.replace(line, active=False) for line in shown)


def _active(name: str, field: Field, value: Any, variant: str) -> Iterator[Line]:
    comment = _comment(field, variant)
    match field.kind:
        case Record(cls) | Pair(Record(cls)):
            yield Line(f"{name}:", comment)
            yield from (line.inside() for line in _record(cls, value, variant))
        case OneOf(variants) | Pair(OneOf(variants)):
            yield Line(f"{name}:", comment)
            others = [word for word in variants if word != value["type"]]
            yield Line(f"{INDENT}type: {value['type']}", f"or {', '.join(others)}" if others else "")
            yield from (line.inside() for line in _record(variants[value["type"]], value, variant))
        case Items(Record(cls)):
            yield Line(f"{name}:", comment)
            yield from (line.inside() for entry in _entries(cls, value) for line in entry)
        case _:
            yield Line(f"{name}: {_scalar(value)}", comment)


def _entries(cls: type, values: list[Values]) -> Iterator[list[Line]]:
    """Entries of a list: the first with all its keys and comments, the others with what is set."""
    first, *others = values
    yield _listed(list(_record(cls, first)))
    for other in others:
        yield _listed([Line(f"{key}: {_scalar(value)}") for key, value in other.items()])


def _listed(lines: list[Line]) -> list[Line]:
    head, *rest = lines
    return [head.inside("- "), *(line.inside() for line in rest)]


def _inactive(name: str, field: Field, default: Any, variant: str) -> Iterator[Line]:
    """A field that is left out, with what it then is."""
    comment = _comment(field, variant)
    if isinstance(field.kind, Record) and dataclasses.is_dataclass(default):
        yield Line(f"{name}:", comment)
        yield from (line.inside() for line in _record(field.kind.cls, {}, variant))
    else:
        yield Line(f"{name}: {_default(default)}".rstrip(), comment)


def _default(default: Any) -> str:
    """A default as it may be written, or nothing."""
    numbers = default if isinstance(default, tuple) else (default,)
    if all(isinstance(number, int | float) and math.isfinite(number) for number in numbers):
        return _scalar(default)
    return default if isinstance(default, str) else ""


def _scalar(value: Any) -> str:
    """A value on one line."""
    match value:
        case Mapping():
            return f"{{{', '.join(f'{key}: {_scalar(entry)}' for key, entry in value.items())}}}"
        case list() | tuple():
            return f"[{', '.join(map(_scalar, value))}]"
        case float():
            return f"{value:.10g}"
    return str(value)


def _comment(field: Field, variant: str) -> str:
    """What a field is, with its unit."""
    unit = _unit(field.kind, variant)
    return f"{unit}; {field.doc}{_forms(field.kind)}" if unit else f"{field.doc}{_forms(field.kind)}"


def _forms(kind: Kind) -> str:
    """What may be written, where it cannot be guessed."""
    match kind:
        case Choice(options):
            return f" ({' or '.join(options)})"
        case Interval():
            return " ([lower, upper] or one number)"
    return ""


def _unit(kind: Kind, variant: str) -> str:
    unit: Quantity = getattr(kind, "unit", DIMENSIONLESS)
    words = unit.unit(variant) if variant else str(unit)
    return "" if words == str(DIMENSIONLESS) else words
