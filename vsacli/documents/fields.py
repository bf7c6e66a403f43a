"""Declaring the fields of a record once, for the file reader, the constructor checks and the documentation.

A record is a frozen, keyword-only dataclass whose attributes are made by the functions below. It may have
these class attributes: `not_yet` names keys that belong to the format but that this version does not act on;
`unit_variant` names the choice on which the units in the record, and in records inside it, depend;
`unit_variant_with` is a key and the choice that counts for them if the key is there.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import FieldProblem, InvalidRecordError
from vsacli.base.units import Quantity
from vsacli.documents.tree import quoted

REQUIRED = dataclasses.MISSING
LARGEST = 1e30
"""Size of a finite number, in SI units, beyond which it is refused: products of a few still are numbers."""

SMALLEST = 1e-30
"""Size below which a number is refused if it cannot be zero: one may divide by it."""

IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")


@dataclass(frozen=True)
class Check:
    """A condition on a single number and the words for it, as in "must be positive".

    `keywords` say it in JSON Schema, as far as that can.
    """

    holds: Callable[[float], bool]
    requirement: str
    keywords: Mapping[str, Any] = dataclasses.field(default_factory=dict, compare=False)

    def problem(self, number: float) -> str | None:
        """Why a number is refused, by the condition or for its size; None if it is not."""
        if not self.holds(number):
            return f"must be {self.requirement}, not {number:g}"
        if math.isfinite(number) and abs(number) > LARGEST:
            return f"must be at most {LARGEST:g} in size, not {number:g}"
        if 0 < abs(number) < SMALLEST and not self.holds(0.0):
            return f"must be at least {SMALLEST:g} in size, not {number:g}"
        return None


_ABOVE_ZERO = {"exclusiveMinimum": 0}
POSITIVE = Check(lambda value: value > 0 and math.isfinite(value), "positive", _ABOVE_ZERO)
POSITIVE_OR_INFINITE = Check(lambda value: value > 0, "positive", _ABOVE_ZERO)
NON_NEGATIVE = Check(lambda value: value >= 0 and math.isfinite(value), "zero or positive", {"minimum": 0})
NON_ZERO = Check(
    lambda value: value != 0 and math.isfinite(value), "finite and not zero", {"not": {"const": 0}}
)
FINITE = Check(math.isfinite, "finite")
_ANY = Check(lambda _: True, "any number")


class Number(NamedTuple):
    """One number with a unit."""

    unit: Quantity


class Integer(NamedTuple):
    """One whole number."""


class Text(NamedTuple):
    """A text; `identifier` restricts it to letters, digits, `_` and `-`, starting with a letter or `_`."""

    identifier: bool = False


class Choice(NamedTuple):
    """One of a few words; `not_yet` are words of the format that this version does not act on."""

    options: tuple[str, ...]
    not_yet: tuple[str, ...] = ()


class Vector(NamedTuple):
    """A list of `length` numbers, read as a tuple."""

    length: int
    unit: Quantity


class Interval(NamedTuple):
    """`[lower, upper]`, read as a pair; a scalar means [-scalar, scalar], if `one_sided` [-inf, scalar]."""

    unit: Quantity
    one_sided: bool = False


class Record(NamedTuple):
    """A mapping read into the record class `cls`."""

    cls: type


class OneOf(NamedTuple):
    """A mapping whose key `type` selects the record class; `not_yet` as for Choice."""

    variants: Mapping[str, type]
    not_yet: tuple[str, ...] = ()


class Items(NamedTuple):
    """A list of one or more values of a kind, read as a tuple; all differ in the text field `unique`."""

    item: Kind
    unique: str | None = None


class Pair(NamedTuple):
    """One value for both sides of a joint, or a list of two, read as a pair."""

    item: Kind


class TableFile(NamedTuple):
    """Path of a CSV file relative to the document, read as a `Table` of these columns."""

    columns: tuple[str, ...]


class PerJoint(NamedTuple):
    """A scalar for all joints, a list, or a mapping by joint name; read as a tuple with one entry a joint.

    Joints that are exempt from `purpose` are named in no mapping and null in a list; their entry is None.
    """

    unit: Quantity
    purpose: str = ""


Single: TypeAlias = "Number | Integer | Text | Choice | Vector | Interval | PerJoint | TableFile"
Kind: TypeAlias = "Single | Record | OneOf | Items | Pair"
"""What a value may look like in a file."""


class Field(NamedTuple):
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
    """A nested value: Record, OneOf, Items, Pair or PerJoint; `check` is for the numbers in it."""
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
        case Text(identifier=True) if not IDENTIFIER.fullmatch(content):
            requirement = "letters, digits, _ and -, beginning with a letter or _"
            yield FieldProblem((name,), f"must be made of {requirement}, not {quoted(content)}")
        case Choice(options=options, not_yet=not_yet) if content not in options:
            yield FieldProblem((name,), unknown_word(content, options, not_yet))
        case Vector(length=length) | Items(item=Vector(length=length)) if problems := list(
            _wrong_lengths((name,), length, content)
        ):
            yield from problems
        case Interval() if not content[0] <= content[1]:
            bounds = f"the lower bound {content[0]:g} exceeds the upper bound {content[1]:g}"
            yield FieldProblem((name,), bounds)
        case Items(unique=str(key)):
            for index, message in repeated(getattr(item, key) for item in content):
                yield FieldProblem((name, index, key), message)
        case _:
            yield from _check_numbers((name,), field.check, content)


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


def _wrong_lengths(path: tuple[str | int, ...], length: int, content: Any) -> Iterator[FieldProblem]:
    if content and isinstance(content[0], tuple):
        for index, item in enumerate(content):
            yield from _wrong_lengths((*path, index), length, item)
    elif len(content) != length:
        yield FieldProblem(path, f"expected {length} numbers, found {len(content)}")


def _check_numbers(path: tuple[str | int, ...], check: Check | None, content: Any) -> Iterator[FieldProblem]:
    if isinstance(content, tuple):
        for index, item in enumerate(content):
            yield from _check_numbers((*path, index), check, item)
    elif (check is not None and content is not None) or isinstance(content, float | int):
        problem = (check or _ANY).problem(content)
        if problem:
            yield FieldProblem(path, problem)
