"""Tables of the fields declared with `vsacli.documents.fields`, in Markdown."""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from vsacli.base.units import DIMENSIONLESS, Quantity
from vsacli.documents.fields import (
    FINITE,
    REQUIRED,
    Choice,
    Field,
    Integer,
    Interval,
    Items,
    Kind,
    Number,
    OneOf,
    Pair,
    PerJoint,
    Record,
    TableFile,
    Text,
    Vector,
    declared,
)

Variants = Mapping[str, type]


class Row(NamedTuple):
    """A field: its key (nested keys joined by dots), what its value is, its default, and its meaning."""

    key: str
    value: str
    default: str
    meaning: str


class Choices(NamedTuple):
    """A field whose key `type` selects a record class."""

    key: str
    kind: OneOf


def table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table."""
    cells = [list(header), *(list(row) for row in rows)]
    cells.insert(1, ["---"] * len(cells[0]))
    return "".join(f"| {' | '.join(map(_escaped, row))} |\n" for row in cells)


def _escaped(cell: str) -> str:
    return cell.replace("|", r"\|")


def record_sections(cls: type, elsewhere: Collection[Variants] = (), prefix: str = "") -> str:
    """Tables of a record class and of the variants its fields may have, except those shown elsewhere."""
    fields = list(_fields(cls, ""))
    parts = [_field_table(row for row in fields if isinstance(row, Row))]
    parts += _not_supported(cls)
    for choices in (field for field in fields if isinstance(field, Choices)):
        key, kind = f"{prefix}{choices.key}", choices.kind
        if kind.variants in elsewhere:
            continue
        for name, variant in kind.variants.items():
            title = f"### `{key}` of `type: {name}`\n\n{_summary(variant)}\n"
            parts.append(f"{title}\n{record_sections(variant, elsewhere, f'{key}.')}")
    return "\n".join(parts)


def variant_sections(variants: Variants) -> str:
    """A section for each variant, named by its word."""
    return "\n".join(
        f"### `type: {name}`\n\n{_summary(variant)}\n\n{record_sections(variant)}"
        for name, variant in variants.items()
    )


def _field_table(rows: Iterable[Row]) -> str:
    return table(("key", "value", "default", "meaning"), ((f"`{row.key}`", *row[1:]) for row in rows))


def _not_supported(cls: type) -> Iterator[str]:
    refused = [f"`{word}`" for word in _refused(cls)]
    if refused:
        yield f"Part of the format, but not supported yet, so refused: {', '.join(refused)}.\n"


def _refused(cls: type) -> Iterator[str]:
    yield from getattr(cls, "not_yet", ())
    for name, (field, _) in declared(cls).items():
        match field.kind:
            case OneOf(not_yet=words):
                yield from (f"{name}: {{type: {word}}}" for word in words)
            case Choice(not_yet=words):
                yield from (f"{name}: {word}" for word in words)
            case Record(inner) | Items(Record(inner)) | Pair(Record(inner)):
                yield from (f"{name}.{word}" for word in _refused(inner))


def _summary(cls: type) -> str:
    return inspect.cleandoc(cls.__doc__ or "")


def _fields(cls: type, prefix: str) -> Iterator[Row | Choices]:
    for name, (field, default) in declared(cls).items():
        key = f"{prefix}{name}"
        yield Row(key, _value(field), _default(default), field.doc)
        match field.kind:
            case Record(inner) | Pair(Record(inner)):
                yield from _fields(inner, f"{key}.")
            case Items(Record(inner)):
                yield from _fields(inner, f"{key}[].")
            case OneOf() as kind:
                yield Choices(key, kind)
            case Pair(OneOf() as kind):
                yield Choices(key, kind)
            case Items(OneOf() as kind):
                yield Choices(f"{key}[]", kind)


def _value(field: Field) -> str:
    words = _kind(field.kind)
    check = field.check
    return words if check is None or check is FINITE else f"{words}; {check.requirement}"


def _kind(kind: Kind) -> str:
    match kind:
        case Number(unit):
            return _unit(unit)
        case Integer():
            return "whole number"
        case Text(identifier):
            return "text of letters, digits, `_` and `-`" if identifier else "text"
        case Choice(options):
            return " or ".join(f"`{option}`" for option in options)
        case Vector(length, unit):
            return f"{length} numbers, {_unit(unit)}"
        case Interval(unit, one_sided):
            alone = "upper" if one_sided else "-x to x"
            return f"[lower, upper], or one number x ({alone}), {_unit(unit)}"
        case PerJoint(unit):
            return f"per joint, {_unit(unit)}"
        case TableFile(columns):
            return f"CSV file with the columns {', '.join(f'`{column}`' for column in columns)}"
    return _nested(kind)


def _nested(kind: Kind) -> str:
    match kind:
        case Record():
            return "mapping"
        case OneOf(variants):
            return f"mapping; `type`: {' or '.join(f'`{name}`' for name in variants)}"
        case Pair(item):
            return f"{_kind(item)}; or a list of two"
        case Items(Record() | OneOf()):
            return "list"
        case Items(item):
            return f"list, each {_kind(item)}"
    raise TypeError(f"no words for the kind {kind}")


def _unit(unit: Quantity) -> str:
    return "number" if unit == DIMENSIONLESS else str(unit)


def _default(default: Any) -> str:
    if default is REQUIRED:
        return "required"
    if default is None or default == "":
        return "none"
    if dataclasses.is_dataclass(default):
        return "none"
    if isinstance(default, tuple):
        return "none" if not any(map(math.isfinite, default)) else str(list(default))
    if isinstance(default, float):
        return f"{default:g}" if math.isfinite(default) else "none"
    return f"`{default}`"
