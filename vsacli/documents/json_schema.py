"""JSON Schema (draft 2020-12) of a declared document, with which editors complete and check YAML.

A schema accepts whatever the reader accepts. It cannot know what only the reader does: the value of an
expression, conditions between fields, the joints of a robot.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping
from functools import singledispatchmethod
from typing import Any, TypeAlias

from vsacli.base.units import DIMENSIONLESS, Quantity
from vsacli.documents.expression import ANGLES, MAX_LENGTH
from vsacli.documents.fields import (
    IDENTIFIER,
    LARGEST,
    REQUIRED,
    Check,
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

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_IDENTIFIER = f"^{IDENTIFIER.pattern}$"
EXPRESSION = r"^[ \t]*[-+(.0-9p][-+*/(). \t0-9eEpi]*$"
ANGLE = r"^[ \t]*[-+(.0-9p][-+*/(). \t0-9eEpi]*(deg)?[ \t]*$"

Schema: TypeAlias = dict[str, Any]


def json_schema(cls: type, format_name: str, title: str) -> Schema:
    """The schema of documents that are read into the record class `cls` and begin with `format: ...`."""
    builder = _Builder()
    document = builder.record(cls, {"format": {"const": format_name}}, ("format",))
    return {"$schema": DIALECT, "title": title, **document, "$defs": builder.definitions}


class _Builder:
    """Schemas of kinds; those of records gather in `definitions` and are referred to."""

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
        schema = self.of_kind(field.kind, field.check)
        plain = _plain(default)
        return {
            "description": _described(field),
            **schema,
            **({} if plain is None else {"default": plain}),
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

    @singledispatchmethod
    def of_kind(self, kind: Kind, check: Check | None) -> Schema:
        """The schema of a value of a kind whose numbers meet a condition."""
        raise NotImplementedError(f"no JSON Schema for {kind}")

    @of_kind.register
    def _number(self, kind: Number, check: Check | None) -> Schema:
        return _number(kind.unit, check)

    @of_kind.register
    def _integer(self, _: Integer, check: Check | None) -> Schema:
        keywords = {} if check is None else check.keywords
        return {"anyOf": [{"type": "integer", **keywords}, _expression(EXPRESSION)]}

    @of_kind.register
    def _text(self, kind: Text, _check: Check | None) -> Schema:
        if kind.identifier:
            return {"type": "string", "pattern": _IDENTIFIER}
        return {"type": ["string", "number"]}

    @of_kind.register
    def _choice(self, kind: Choice, _check: Check | None) -> Schema:
        return {"enum": list(kind.options)}

    @of_kind.register
    def _vector(self, kind: Vector, check: Check | None) -> Schema:
        return _list_of(_number(kind.unit, check), kind.length)

    @of_kind.register
    def _interval(self, kind: Interval, _check: Check | None) -> Schema:
        bound = _number(kind.unit, None)
        return {"anyOf": [*bound["anyOf"], _list_of(bound, 2)]}

    @of_kind.register
    def _record(self, kind: Record, _check: Check | None) -> Schema:
        return self._reference(kind.cls)

    @of_kind.register
    def _one_of(self, kind: OneOf, _check: Check | None) -> Schema:
        return {
            "type": "object",
            "properties": {"type": {"enum": list(kind.variants)}},
            "required": ["type"],
            "allOf": [
                {
                    "if": {"properties": {"type": {"const": word}}},
                    "then": self._reference(variant, word),
                }
                for word, variant in kind.variants.items()
            ],
        }

    @of_kind.register
    def _items(self, kind: Items, check: Check | None) -> Schema:
        return {"type": "array", "minItems": 1, "items": self.of_kind(kind.item, check)}

    @of_kind.register
    def _pair(self, kind: Pair, check: Check | None) -> Schema:
        item = self.of_kind(kind.item, check)
        return {"if": {"type": "array"}, "then": _list_of(item, 2), "else": item}

    @of_kind.register
    def _table_file(self, _: TableFile, _check: Check | None) -> Schema:
        return {"type": "string"}

    @of_kind.register
    def _per_joint(self, kind: PerJoint, check: Check | None) -> Schema:
        number = _number(kind.unit, check)
        return {
            "anyOf": [
                *number["anyOf"],
                {"type": "array", "minItems": 1, "items": {"anyOf": [*number["anyOf"], {"type": "null"}]}},
                {
                    "type": "object",
                    "propertyNames": {"pattern": _IDENTIFIER},
                    "additionalProperties": {"anyOf": [*number["anyOf"], {"type": "null"}]},
                },
            ]
        }


def _number(unit: Quantity, check: Check | None) -> Schema:
    keywords = {"minimum": -LARGEST, "maximum": LARGEST, **({} if check is None else check.keywords)}
    pattern = ANGLE if {unit.revolute, unit.prismatic} & set(ANGLES) else EXPRESSION
    return {"anyOf": [{"type": "number", **keywords}, _expression(pattern)]}


def _expression(pattern: str) -> Schema:
    return {"type": "string", "pattern": pattern, "maxLength": MAX_LENGTH}


def _list_of(item: Schema, length: int) -> Schema:
    return {"type": "array", "items": item, "minItems": length, "maxItems": length}


def _described(field: Field) -> str:
    unit = getattr(field.kind, "unit", DIMENSIONLESS)
    return field.doc if unit == DIMENSIONLESS else f"{field.doc}, {unit}"


def _plain(default: Any) -> Any:
    """A default that a document could hold, or None."""
    match default:
        case bool() | str() if default != "":
            return default
        case int() | float() if math.isfinite(default):
            return default
        case tuple() if all(isinstance(entry, int | float) and math.isfinite(entry) for entry in default):
            return list(default)
    return None
