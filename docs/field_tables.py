"""Tables of the fields declared with `vsacli.documents.fields`, in Markdown."""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from vsacli.documents.fields import FINITE, REQUIRED, declared
from vsacli.documents.kinds.nested import refused_in
from vsacli.documents.records import Field, on_one_line

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


def _summary(cls: type) -> str:
    return inspect.cleandoc(cls.__doc__ or "")


def _fields(cls: type, prefix: str) -> Iterator[Row | Choices]:
    for name, (field, default) in declared(cls).items():
        key = f"{prefix}{name}{field.kind.marks}"
        yield Row(f"{prefix}{name}", _value(field), _default(default), field.doc)
        records = field.kind.records
        if "" in records:
            yield from _fields(records[""], f"{key}.")
        elif records:
            yield Choices(key, records)


def _value(field: Field) -> str:
    words = field.kind.words
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
