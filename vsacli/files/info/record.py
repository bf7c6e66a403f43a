"""Records of declared fields as plain values."""

from __future__ import annotations

import dataclasses
from typing import Any

from vsacli.documents.fields import OneOf, Pair, declared
from vsacli.documents.table import Table


def plain(content: Any) -> Any:
    """A record as a mapping by field name, tables as the path of their file; other values as they are."""
    match content:
        case Table():
            return content.source.path
        case tuple():
            return [plain(entry) for entry in content]
        case _ if dataclasses.is_dataclass(content) and declared(type(content)):
            return _plain_record(content)
    return content


def _plain_record(record: Any) -> dict[str, Any]:
    """The fields of a record; that of a variant begins with its `type`."""
    entries: dict[str, Any] = {}
    for name, (field, _) in declared(type(record)).items():
        value = getattr(record, name)
        match field.kind:
            case OneOf() as kind:
                entries[name] = _variant(kind, value)
            case Pair(OneOf() as kind):
                entries[name] = [_variant(kind, side) for side in value]
            case _:
                entries[name] = plain(value)
    return entries


def _variant(kind: OneOf, record: Any) -> dict[str, Any]:
    word = next(word for word, variant in kind.variants.items() if type(record) is variant)
    return {"type": word, **plain(record)}
