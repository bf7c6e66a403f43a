"""A YAML document with a comment on every key that is declared; optional ones stand commented out."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Iterator
from typing import Any

from vsacli.base.units import DIMENSIONLESS
from vsacli.documents.fields import REQUIRED, Record, declared
from vsacli.documents.records import Field, Line, Values, on_one_line

COMMENT_COLUMN = 44
WIDTH = 110


def commented_document(format_name: str, cls: type, values: Values, head: Iterable[str] = ()) -> str:
    """A document of the record class `cls`.

    Args:
        format_name: what its key `format` says.
        cls: the record class of the whole document.
        values: of every required field, and of the optional ones that shall be set.
        head: lines of comment before it.
    """
    lines = [Line(f"format: {format_name}"), *_record(cls, values, "")]
    comments = [f"# {line}".rstrip() for line in head]
    return "\n".join([*comments, *(text for line in lines for text in _rendered(line))]) + "\n"


def _rendered(line: Line) -> Iterator[str]:
    """A line and its comment, beside it or, if it is long, before it, on as many lines as it takes."""
    text = line.text if line.active else f"# {line.text}"
    comments = [f"# {part}" for part in textwrap.wrap(line.comment, WIDTH - COMMENT_COLUMN - 2)]
    if len(text) < COMMENT_COLUMN and comments:
        text = f"{text:<{COMMENT_COLUMN}}{comments.pop(0)}"
        yield text
        yield from (f"{'':<{COMMENT_COLUMN}}{comment}" for comment in comments)
    else:
        yield from (f"{'':<{COMMENT_COLUMN}}{comment}" for comment in comments)
        yield text


def _record(cls: type, values: Values, variant: str) -> Iterator[Line]:
    """All fields of a record; those left out stand inactive, with what they then are."""
    variant = str(values.get(getattr(cls, "unit_variant", ""), variant))

    def of_record(inner: type, its_values: Values) -> Iterator[Line]:
        return _record(inner, its_values, variant)

    for name, (field, default) in declared(cls).items():
        comment = _comment(field, variant)
        if name in values:
            yield from field.kind.lines(name, values[name], comment, of_record)
        elif default is REQUIRED:
            raise KeyError(f"{cls.__name__} needs a value of {name}")
        elif isinstance(field.kind, Record):
            example = {} if default is not None else _example(field.kind.cls, variant)
            yield from (line.inactive() for line in field.kind.lines(name, example, comment, of_record))
        else:
            yield Line(f"{name}: {_default(default)}".rstrip(), comment).inactive()


def _example(cls: Any, variant: str) -> Values:
    """Values of a record that is absent by default."""
    values: Values = cls.example(variant)
    return values


def _default(default: Any) -> str:
    """A default as it may be written, or nothing."""
    numbers = default if isinstance(default, tuple) else (default,)
    if all(isinstance(number, int | float) and math.isfinite(number) for number in numbers):
        return on_one_line(default)
    return default if isinstance(default, str) else ""


def _comment(field: Field, variant: str) -> str:
    """What a field is, with its unit."""
    unit = field.quantity.unit(variant) if variant else str(field.quantity)
    sentence = f"{field.doc}{field.kind.forms}"
    return sentence if unit == str(DIMENSIONLESS) else f"{unit}; {sentence}"
