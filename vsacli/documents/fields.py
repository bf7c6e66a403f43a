"""Declaration of the fields of a record, shared by file reader, constructor checks and documentation.

Record classes import everything they need from here: the functions that create attributes, the kinds of
nested values, and conditions. `field_kinds` lists further attributes of record classes.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from vsacli.base.units import Quantity
from vsacli.documents.field_kinds import (
    IDENTIFIER,
    LARGEST,
    REQUIRED,
    SMALLEST,
    Boolean,
    Check,
    Choice,
    Field,
    Integer,
    Interval,
    Kind,
    Name,
    NamedNumbers,
    Number,
    OwnKind,
    Share,
    TableFile,
    Text,
    Vector,
    check_fields,
    declared,
)
from vsacli.documents.nested import Items, OneOf, OneOrMore, Pair, PerJoint, Record

__all__ = [
    "FINITE",
    "IDENTIFIER",
    "LARGEST",
    "NON_NEGATIVE",
    "NON_ZERO",
    "POSITIVE",
    "POSITIVE_OR_INFINITE",
    "REQUIRED",
    "SMALLEST",
    "Boolean",
    "Check",
    "Choice",
    "Integer",
    "Interval",
    "Items",
    "Kind",
    "Name",
    "NamedNumbers",
    "Number",
    "OneOf",
    "OneOrMore",
    "OwnKind",
    "Pair",
    "PerJoint",
    "Record",
    "Share",
    "TableFile",
    "Text",
    "Vector",
    "boolean",
    "check_fields",
    "choice",
    "declared",
    "integer",
    "interval",
    "number",
    "text",
    "value",
    "vector",
]

_ABOVE_ZERO = {"exclusiveMinimum": 0}
POSITIVE = Check(lambda value: 0 < value < math.inf, "positive", _ABOVE_ZERO)
POSITIVE_OR_INFINITE = Check(lambda value: value > 0, "positive", _ABOVE_ZERO)
NON_NEGATIVE = Check(lambda value: 0 <= value < math.inf, "zero or positive", {"minimum": 0})
NON_ZERO = Check(
    lambda value: value != 0 and abs(value) < math.inf, "finite and not zero", {"not": {"const": 0}}
)
FINITE = Check(lambda value: abs(value) < math.inf, "finite")


def _declare(field: Field, default: Any) -> Any:
    return dataclasses.field(default=default, metadata={"field": field}, kw_only=True)


def number(unit: Quantity, doc: str, *, check: Check = FINITE, default: Any = REQUIRED) -> Any:
    """Declare a number."""
    return _declare(Field(Number(unit), doc, check), default)


def integer(doc: str, *, check: Check, default: Any = REQUIRED) -> Any:
    """Declare a whole number."""
    return _declare(Field(Integer(), doc, check), default)


def boolean(doc: str, *, default: Any = REQUIRED) -> Any:
    """Declare a truth value."""
    return _declare(Field(Boolean(), doc), default)


def text(doc: str, *, identifier: bool = False, default: Any = REQUIRED) -> Any:
    """Declare a text."""
    return _declare(Field(Text(identifier), doc), default)


def choice(
    options: tuple[str, ...], doc: str, *, default: Any = REQUIRED, not_yet: tuple[str, ...] = ()
) -> Any:
    """Declare a choice from a few words."""
    return _declare(Field(Choice(options, not_yet), doc), default)


def vector(length: int, unit: Quantity, doc: str, *, default: Any = REQUIRED) -> Any:
    """Declare a list of finite numbers."""
    return _declare(Field(Vector(length, unit), doc, FINITE), default)


def interval(unit: Quantity, doc: str, *, lowest: float | None = None, default: Any = REQUIRED) -> Any:
    """Declare an interval; one number x means [-x, x], or [lowest, x] with `lowest`."""
    return _declare(Field(Interval(unit, lowest), doc), default)


def value(kind: Kind, doc: str, *, check: Check | None = None, default: Any = REQUIRED) -> Any:
    """Declare a nested value: Record, OneOf, Items, Pair or PerJoint; `check` applies to its numbers."""
    return _declare(Field(kind, doc, check), default)
