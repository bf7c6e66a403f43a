"""JSON Schema (draft 2020-12) of a declared document, with which editors complete and check YAML.

A schema accepts whatever the reader accepts. It cannot know what only the reader does: the value of an
expression, conditions between fields, the joints of a robot.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping
from typing import Any

from vsacli.base.units import DIMENSIONLESS
from vsacli.documents.records import REQUIRED, Field, Schema, declared

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def json_schema(cls: type, format_name: str, title: str) -> Schema:
    """The schema of documents that are read into the record class `cls` and begin with `format: ...`."""
    builder = _Builder()
    document = builder.record(cls, {"format": {"const": format_name}}, ("format",))
    return {"$schema": DIALECT, "title": title, **document, "$defs": builder.definitions}


class _Builder:
    """Schemas of records, which gather in `definitions` and are referred to."""

    def __init__(self) -> None:
        self.definitions: dict[str, Schema] = {}

    def record(self, cls: type, beside: Mapping[str, Schema], required: tuple[str, ...] = ()) -> Schema:
        """The schema of a mapping with the fields of a record class, and keys `beside` them."""
        fields = declared(cls)
        return {
            "type": "object",
            "properties": {
                **beside,
                **{name: self._field(field, default) for name, (field, default) in fields.items()},
            },
            "required": [*required, *(name for name, (_, default) in fields.items() if default is REQUIRED)],
            "additionalProperties": False,
        }

    def _field(self, field: Field, default: Any) -> Schema:
        schema = field.kind.schema(field.check, self._reference)
        shown = _json_value(default)
        return {
            "description": _described(field),
            **schema,
            **({} if shown is None else {"default": shown}),
        }

    def _reference(self, cls: type, word: str | None = None) -> Schema:
        """A reference to the definition of a record, of the variant `word` if it is one of several."""
        name = cls.__name__ if word is None else f"{cls.__name__}.{word}"
        if name not in self.definitions:
            self.definitions[name] = {}  # so that a record may hold records of its own class
            beside = {} if word is None else {"type": {"const": word}}
            summary = inspect.cleandoc(cls.__doc__ or "").partition("\n")[0]
            self.definitions[name] = {"description": summary, **self.record(cls, beside)}
        return {"$ref": f"#/$defs/{name}"}


def _described(field: Field) -> str:
    return field.doc if field.quantity == DIMENSIONLESS else f"{field.doc}, {field.quantity}"


def _json_value(default: Any) -> Any:
    """A default that a document could hold, or None."""
    match default:
        case bool() | str() if default != "":
            return default
        case int() | float() if math.isfinite(default):
            return default
        case tuple() if all(isinstance(entry, int | float) and math.isfinite(entry) for entry in default):
            return list(default)
    return None
