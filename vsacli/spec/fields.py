"""Declaring the fields of a record once, for the file reader, the constructor checks and the documentation.

A record is a frozen, keyword-only dataclass whose attributes are made by the functions below. It may have two
class attributes: `not_yet` names keys that belong to the format but that this version does not act on;
`unit_variant` names the choice on which the units in the record, and in records inside it, depend.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from vsacli.errors import FieldProblem, InvalidRecordError
from vsacli.spec.tree import quoted
from vsacli.suggestions import did_you_mean
from vsacli.units import Quantity

REQUIRED = dataclasses.MISSING
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")


@dataclass(frozen=True)
class Check:
    """A condition on a single number and the words for it, as in "must be positive"."""

    holds: Callable[[float], bool]
    requirement: str


POSITIVE = Check(lambda value: value > 0 and math.isfinite(value), "positive")
POSITIVE_OR_INFINITE = Check(lambda value: value > 0, "positive")
NON_NEGATIVE = Check(lambda value: value >= 0 and math.isfinite(value), "zero or positive")
FINITE = Check(math.isfinite, "finite")


@dataclass(frozen=True)
class Kind:
    """What a value may look like in a file; the subclasses are the alternatives."""


@dataclass(frozen=True)
class Number(Kind):
    """One number with a unit."""

    unit: Quantity


@dataclass(frozen=True)
class Integer(Kind):
    """One whole number."""


@dataclass(frozen=True)
class Text(Kind):
    """A text; `identifier` restricts it to letters, digits, `_` and `-`, starting with a letter or `_`."""

    identifier: bool = False


@dataclass(frozen=True)
class Choice(Kind):
    """One of a few words; `not_yet` are words of the format that this version does not act on."""

    options: tuple[str, ...]
    not_yet: tuple[str, ...] = ()


@dataclass(frozen=True)
class Vector(Kind):
    """A list of `length` numbers, read as a tuple."""

    length: int
    unit: Quantity


@dataclass(frozen=True)
class Interval(Kind):
    """`[lower, upper]`, read as a pair; a scalar means [-scalar, scalar], if `one_sided` [-inf, scalar]."""

    unit: Quantity
    one_sided: bool = False


@dataclass(frozen=True)
class Record(Kind):
    """A mapping read into the record class `cls`."""

    cls: type


@dataclass(frozen=True)
class OneOf(Kind):
    """A mapping whose key `type` selects the record class; `not_yet` as for Choice."""

    variants: Mapping[str, type]
    not_yet: tuple[str, ...] = ()


@dataclass(frozen=True)
class Items(Kind):
    """A list of one or more values of a kind, read as a tuple; all differ in the text field `unique`."""

    item: Kind
    unique: str | None = None


@dataclass(frozen=True)
class Pair(Kind):
    """One value for both sides of a joint, or a list of two, read as a pair."""

    item: Kind


@dataclass(frozen=True)
class TableFile(Kind):
    """Path of a CSV file relative to the document, read as a `vsacli.spec.table.Table` of these columns."""

    columns: tuple[str, ...]


@dataclass(frozen=True)
class PerJoint(Kind):
    """A scalar for all joints, a list, or a mapping by joint name; read as a tuple with one entry a joint.

    Joints that have no such quantity are named in no mapping and null in a list; their entry is None.
    """

    unit: Quantity


@dataclass(frozen=True)
class Field:
    """A declared field: the kind of its value, one sentence about it, and the condition on each number."""

    kind: Kind
    doc: str
    check: Check | None = None


def _declare(field: Field, default: Any, **options: Any) -> Any:
    return dataclasses.field(default=default, metadata={"field": field}, kw_only=True, **options)


def number(
    unit: Quantity, doc: str, *, check: Check = FINITE, default: Any = REQUIRED, compare: bool = True
) -> Any:
    """A number; `compare=False` keeps it out of the equality of two records."""
    return _declare(Field(Number(unit), doc, check), default, compare=compare)


def integer(doc: str, *, check: Check, default: Any = REQUIRED) -> Any:
    """A whole number."""
    return _declare(Field(Integer(), doc, check), default)


def text(doc: str, *, identifier: bool = False, default: Any = REQUIRED) -> Any:
    """A text."""
    return _declare(Field(Text(identifier), doc), default)


def choice(
    options: tuple[str, ...], doc: str, *, default: Any = REQUIRED, not_yet: tuple[str, ...] = ()
) -> Any:
    """One of a few words."""
    return _declare(Field(Choice(options, not_yet), doc), default)


def vector(length: int, unit: Quantity, doc: str, *, default: Any = REQUIRED) -> Any:
    """A list of finite numbers."""
    return _declare(Field(Vector(length, unit), doc, FINITE), default)


def interval(unit: Quantity, doc: str, *, one_sided: bool = False, default: Any = REQUIRED) -> Any:
    """A lower and an upper bound, in this order."""
    return _declare(Field(Interval(unit, one_sided), doc), default)


def value(kind: Kind, doc: str, *, check: Check | None = None, default: Any = REQUIRED) -> Any:
    """A nested value: Record, OneOf, Items, Pair or PerJoint; `check` is for the numbers of a PerJoint."""
    return _declare(Field(kind, doc, check), default)


def declared(cls: type) -> dict[str, tuple[Field, Any]]:
    """The fields of a record class in file order, each with its default (REQUIRED where it has none)."""
    return {
        attribute.name: (attribute.metadata["field"], attribute.default)
        for attribute in dataclasses.fields(cls)
        if "field" in attribute.metadata
    }


def check_fields(record: Any, *further: FieldProblem) -> None:
    """Check every declared field of a record; for `__post_init__`.

    Args:
        record: an instance of a record class.
        further: problems the record found by itself, reported together with these.

    Raises:
        InvalidRecordError: naming each field whose value it cannot have.
    """
    problems = [
        problem
        for name, (field, default) in declared(type(record)).items()
        if not (default is None and getattr(record, name) is None)
        for problem in field_problems(name, field, getattr(record, name))
    ]
    if problems or further:
        raise InvalidRecordError(type(record).__name__, [*problems, *further])


def field_problems(name: str, field: Field, content: Any) -> Iterator[FieldProblem]:
    """What is wrong with the content of a field; the one place where declarations are enforced."""
    match field.kind:
        case Text(identifier=True) if not _IDENTIFIER.fullmatch(content):
            requirement = "letters, digits, _ and -, beginning with a letter or _"
            yield FieldProblem((name,), f"must be made of {requirement}, not {quoted(content)}")
        case Choice(options=options, not_yet=not_yet) if content not in options:
            yield FieldProblem((name,), unknown_word(content, options, not_yet))
        case Vector(length=length) if len(content) != length:
            yield FieldProblem((name,), f"expected {length} numbers, found {len(content)}")
        case Interval() if not content[0] <= content[1]:
            bounds = f"the lower bound {content[0]:g} exceeds the upper bound {content[1]:g}"
            yield FieldProblem((name,), bounds)
        case Items(unique=str(key)):
            for index, message in repeated(getattr(item, key) for item in content):
                yield FieldProblem((name, index, key), message)
        case _ if field.check is not None:
            yield from _check_numbers(name, field.check, content)


def unknown_word(word: str, options: Iterable[str], not_yet: tuple[str, ...]) -> str:
    """Why a word is none of the options."""
    if word in not_yet:
        return f"{word!r} is not supported yet"
    return f"unknown word {quoted(word)}{did_you_mean(word, options)}"


def repeated(words: Iterable[str | None]) -> Iterator[tuple[int, str]]:
    """Index of, and message about, each word that stood before; None never counts."""
    seen: set[str] = set()
    for index, word in enumerate(words):
        if word is not None and word in seen:
            yield index, f"{quoted(word)} is taken by another entry; each needs its own"
        elif word is not None:
            seen.add(word)


def _check_numbers(name: str, check: Check, content: Any) -> Iterator[FieldProblem]:
    in_tuple = isinstance(content, tuple)
    for index, item in enumerate(content if in_tuple else (content,)):
        if item is not None and not check.holds(item):
            path = (name, index) if in_tuple else (name,)
            yield FieldProblem(path, f"must be {check.requirement}, not {item:g}")
