"""Tables of the fields declared with `vsacli.documents.fields`, in Markdown."""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from vsacli.base.texts import MOST_LETTERS, on_one_line
from vsacli.base.units import DIMENSIONLESS, Quantity
from vsacli.documents.fields import (
    FINITE,
    REQUIRED,
    Boolean,
    Field,
    Integer,
    Interval,
    Items,
    ItemsByName,
    Name,
    NamedNumbers,
    NumberList,
    NumberWithUnit,
    OneOf,
    OneOrMore,
    OwnKind,
    PairOf,
    PerJoint,
    RecordOf,
    Share,
    TablePath,
    Text,
    ValueKind,
    WordChoice,
    declared_fields,
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
    variants: Variants


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
        if choices.variants in elsewhere:
            continue
        key = f"{prefix}{choices.key}"
        for name, variant in choices.variants.items():
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
    refused = [f"`{word}`" for word in refused_in(cls)]
    if refused:
        yield f"Part of the format, but not supported yet, so refused: {', '.join(refused)}.\n"


def refused_in(cls: type) -> Iterator[str]:
    """Keys and words in a record class that belong to the format but are not supported yet."""
    yield from getattr(cls, "not_yet", ())
    for name, (field, _) in declared_fields(cls).items():
        yield from _refused(field.kind, name)


def _refused(kind: ValueKind, name: str) -> Iterator[str]:
    match kind:
        case WordChoice():
            yield from (f"{name}: {word}" for word in kind.not_yet)
        case OneOf():
            yield from (f"{name}: {{type: {word}}}" for word in kind.not_yet)
        case RecordOf(cls):
            yield from (f"{name}.{word}" for word in refused_in(cls))
        case Items(item=item) | PairOf(item):
            yield from _refused(item, name)


def words_of(kind: ValueKind) -> str:
    """What a value is, in a few words with its unit."""
    match kind:
        case OwnKind():
            return kind.words
        case RecordOf():
            return "mapping"
        case OneOf(variants):
            return f"mapping; `type`: {' or '.join(f'`{name}`' for name in variants)}"
        case OneOrMore(item=item):
            return f"{words_of(item)}; or a list of these"
        case ItemsByName():
            return "mapping by name"
        case Items(item=item):
            return "list" if kind.records else f"list, each {words_of(item)}"
        case PairOf(item):
            return f"{words_of(item)}; or a list of two"
    return _words_of_numbers(kind) if kind.unit else _words_of_one(kind)


def _words_of_numbers(kind: ValueKind) -> str:
    unit = _unit(kind.unit or DIMENSIONLESS)
    match kind:
        case Share():
            return "share, such as `3 %` or `0.03`"
        case NumberList(length=length):
            return f"{length} numbers, {unit}"
        case Interval(lowest=lowest):
            alone = {None: "-x to x", -math.inf: "upper"}.get(lowest, f"{lowest} to x")
            return f"[lower, upper], or one number x ({alone}), {unit}"
        case PerJoint():
            return f"per joint, {unit}"
    assert isinstance(kind, NumberWithUnit)
    return unit


def _words_of_one(kind: ValueKind) -> str:
    match kind:
        case Name():
            return f"text in one line, of at most {MOST_LETTERS} letters"
        case Text(identifier=identifier):
            return "text of letters, digits, `_` and `-`" if identifier else "text"
        case WordChoice(options=options, words=words):
            return words or " or ".join(f"`{option}`" for option in options)
        case TablePath(columns=columns):
            return f"CSV file with the columns {', '.join(f'`{column}`' for column in columns)}"
    return {
        Integer: "whole number",
        Boolean: "`true` or `false`",
        NamedNumbers: "mapping from names to numbers in SI units",
    }[type(kind)]


def _unit(unit: Quantity) -> str:
    return "number" if unit == DIMENSIONLESS else str(unit)


def _summary(cls: type) -> str:
    return inspect.cleandoc(cls.__doc__ or "")


def _fields(cls: type, prefix: str) -> Iterator[Row | Choices]:
    for name, (field, default) in declared_fields(cls).items():
        if name == getattr(cls, "keyed_by", None):
            continue
        entries = ".NAME" if isinstance(field.kind, ItemsByName) else "[]"
        key = f"{prefix}{name}{entries if isinstance(field.kind, Items) else ''}"
        yield Row(f"{prefix}{name}", _value(field), _default(default), field.doc)
        records = field.kind.records
        if "" in records:
            yield from _fields(records[""], f"{key}.")
        elif records:
            yield Choices(key, records)


def _value(field: Field) -> str:
    words = words_of(field.kind)
    check = field.check
    return words if check is None or check is FINITE else f"{words}; {check.requirement}"


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
    return f"`{on_one_line(default)}`"
