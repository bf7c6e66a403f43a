"""JSON Schema (draft 2020-12) of a declared document, with which editors complete and check YAML.

A schema accepts everything that the reader accepts. It cannot express values of expressions, most conditions
between fields, or the joints of a robot.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping
from typing import Any

from vsacli.base.texts import MOST_LETTERS
from vsacli.base.units import ANY_SI_UNIT, DIMENSIONLESS, Quantity
from vsacli.documents.fields import (
    IDENTIFIER,
    LARGEST,
    REQUIRED,
    Boolean,
    Check,
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
    Schema,
    Share,
    Text,
    ValueKind,
    WordChoice,
    declared_fields,
)
from vsacli.documents.number import ANGLES, MAX_LENGTH

DIALECT = "https://json-schema.org/draft/2020-12/schema"

EXPRESSION = r"^[ \t]*[-+(.0-9p][-+*/(). \t0-9eEpi]*$"
ANGLE = r"^[ \t]*[-+(.0-9p][-+*/(). \t0-9eEpi]*(deg)?[ \t]*$"
"""Regular expressions of expressions without and with degrees."""

PRINTABLE = r"^[^\x00-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]+$"
"""Regular expression of a name."""


def json_schema(cls: type, format_name: str, title: str) -> Schema:
    """Return the schema of documents read into the record class `cls`, which begin with `format: ...`."""
    builder = _SchemaBuilder()
    document = builder.record_schema(cls, {"format": {"const": format_name}}, ("format",))
    return {"$schema": DIALECT, "title": title, **document, "$defs": builder.definitions}


class _SchemaBuilder:
    """A builder of record schemas, which are collected in `definitions` and referenced."""

    def __init__(self) -> None:
        self.definitions: dict[str, Schema] = {}

    def record_schema(
        self, cls: type, beside: Mapping[str, Schema], required: tuple[str, ...] = ()
    ) -> Schema:
        """Return the schema of a mapping with a record class's fields and the further keys `beside`."""
        key = getattr(cls, "keyed_by", None)
        fields = {name: field for name, field in declared_fields(cls).items() if name != key}
        return {
            "type": "object",
            "properties": {
                **beside,
                **{name: self._field_schema(field, default) for name, (field, default) in fields.items()},
            },
            "required": [*required, *(name for name, (_, default) in fields.items() if default is REQUIRED)],
            "additionalProperties": False,
            **_required_unless_keywords(getattr(cls, "required_unless", {})),
        }

    def _field_schema(self, field: Field, default: Any) -> Schema:
        description = field.doc if field.quantity == DIMENSIONLESS else f"{field.doc}, {field.quantity}"
        json_default = None if isinstance(field.kind, ItemsByName) else _json_default(default)
        schema = self._value_schema(field.kind, field.check)
        return {
            "description": description,
            **schema,
            **({} if json_default is None else {"default": json_default}),
        }

    def _value_schema(self, kind: ValueKind, check: Check | None) -> Schema:
        """Return the schema of values of a kind; their numbers must meet the condition."""
        match kind:
            case OwnKind():
                return kind.schema(self._reference)
            case RecordOf(cls):
                return self._reference(cls)
            case OneOf(variants):
                return self._variants_schema(variants)
            case ItemsByName(item=item):
                entry = self._value_schema(item, check)
                names = {"pattern": f"^{IDENTIFIER.pattern}$"}
                return {
                    "type": "object",
                    "minProperties": 1,
                    "propertyNames": names,
                    "additionalProperties": entry,
                }
            case OneOrMore(item=item):
                return {
                    "anyOf": [self._value_schema(item, check), _list_schema(self._value_schema(item, check))]
                }
            case Items(item=item):
                return _list_schema(self._value_schema(item, check))
            case PairOf(item):
                item_schema = self._value_schema(item, check)
                return {"if": {"type": "array"}, "then": _list_schema(item_schema, 2), "else": item_schema}
        return _single_value_schema(kind, check) or _numbers_schema(kind, check)

    def _variants_schema(self, variants: Mapping[str, type]) -> Schema:
        """Return the schema of a mapping whose `type` selects its other keys."""
        return {
            "type": "object",
            "properties": {"type": {"enum": list(variants)}},
            "required": ["type"],
            "allOf": [
                {"if": {"properties": {"type": {"const": word}}}, "then": self._reference(variant, word)}
                for word, variant in variants.items()
            ],
        }

    def _reference(self, cls: type, word: str | None = None) -> Schema:
        """Return a reference to the definition of a record, or of its variant `word`."""
        name = cls.__name__ if word is None else f"{cls.__name__}.{word}"
        if name not in self.definitions:
            self.definitions[name] = {}  # ends the recursion of a record that holds its own class
            beside = {} if word is None else {"type": {"const": word}}
            summary = inspect.cleandoc(cls.__doc__ or "").partition("\n")[0]
            self.definitions[name] = {"description": summary, **self.record_schema(cls, beside)}
        return {"$ref": f"#/$defs/{name}"}


def _required_unless_keywords(required_unless: Mapping[str, tuple[str, float]]) -> Schema:
    """Return keywords that require keys; expressions, whose values no schema knows, require none."""
    conditions = [
        {
            "if": {"properties": {other: {"type": "number", "not": {"const": value}}}, "required": [other]},
            "then": {"required": [name]},
        }
        for name, (other, value) in required_unless.items()
    ]
    return {"allOf": conditions} if conditions else {}


def _list_schema(item: Schema, length: int | None = None) -> Schema:
    """Return the schema of a list with the given length, or of any list that is not empty."""
    if length is None:
        return {"type": "array", "minItems": 1, "items": item}
    return {"type": "array", "items": item, "minItems": length, "maxItems": length}


def _single_value_schema(kind: ValueKind, check: Check | None) -> Schema:
    """Return the schema of a single value; empty if the kind has several numbers."""
    match kind:
        case Share():
            per_cent = {"type": "string", "pattern": EXPRESSION[:-1] + "%$"}
            return {"anyOf": [*_number_schema(kind.unit, check)["anyOf"], per_cent]}
        case NumberWithUnit():
            return _number_schema(kind.unit, check)
        case Integer():
            keywords = {} if check is None else check.keywords
            return {"anyOf": [{"type": "integer", **keywords}, _expression_schema(EXPRESSION)]}
        case Boolean():
            return {"type": "boolean"}
        case Name():
            lengths = {"minLength": 1, "maxLength": MOST_LETTERS}
            return {"type": ["string", "number"], **lengths, "pattern": PRINTABLE}
        case Text(identifier=True):
            return {"type": "string", "pattern": f"^{IDENTIFIER.pattern}$"}
        case Text():
            return {"type": ["string", "number"]}  # YAML may read a text as a number
        case WordChoice():
            return {"enum": list(kind.options)}
    return {}


def _numbers_schema(kind: ValueKind, check: Check | None) -> Schema:
    """Return the schema of several numbers, or of the path of a file with numbers."""
    match kind:
        case NumberList():
            return _list_schema(_number_schema(kind.item.unit, check), kind.length)
        case Interval():
            bound_schema = _number_schema(kind.item.unit, None)
            return {"anyOf": [*bound_schema["anyOf"], _list_schema(bound_schema, 2)]}
        case NamedNumbers():
            return {"type": "object", "additionalProperties": _number_schema(ANY_SI_UNIT, check)}
        case PerJoint():
            numbers = _number_schema(kind.unit, check)["anyOf"]
            entry = {"anyOf": [*numbers, {"type": "null"}]}
            names = {"pattern": f"^{IDENTIFIER.pattern}$"}
            by_name = {"type": "object", "propertyNames": names, "additionalProperties": entry}
            return {"anyOf": [*numbers, _list_schema(entry), by_name]}
    return {"type": "string"}


def _number_schema(unit: Quantity, check: Check | None) -> Schema:
    """Return the schema of a number within bounds, or of an expression."""
    keywords = {"minimum": -LARGEST, "maximum": LARGEST, **({} if check is None else check.keywords)}
    pattern = ANGLE if {unit.revolute, unit.prismatic} & set(ANGLES) else EXPRESSION
    return {"anyOf": [{"type": "number", **keywords}, _expression_schema(pattern)]}


def _expression_schema(pattern: str) -> Schema:
    return {"type": "string", "pattern": pattern, "maxLength": MAX_LENGTH}


def _json_default(default: Any) -> Any:
    """Return a default in a form that a document can hold, or None."""
    match default:
        case bool() | str() if default != "":
            return default
        case int() | float() if math.isfinite(default):
            return default
        case tuple() if all(isinstance(entry, int | float) and math.isfinite(entry) for entry in default):
            return list(default)
    return None
