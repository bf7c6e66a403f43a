"""Declaration of the fields of records: conditions, kinds of values, and functions that declare a field.

A declaration is data, on which each task is one function for all kinds: reading in `record_reader`, checks in
`record_checks`, JSON Schema in `json_schema`, lines of a template in `commented`, arrays, JSON values and
numbers in `record_values`.

A record class is a frozen dataclass that derives from `record_checks.DeclaredRecord` and whose attributes are
made by the functions at the end. It may have these class attributes: `not_yet` names keys of the format that
this version does not support; `unit_variant` names the choice that determines the units in the record and in
nested records; `keyed_by` names the field that is the record's key, see `ItemsByName`; `unit_variants` maps
its words to unit variants, and words without one keep that of the enclosing record (without the mapping, the
words are the variants); `required_unless` maps a key to another one and a number: the first is required with
the second unless that has this number.
"""

from __future__ import annotations

import dataclasses
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from vsacli.base.errors import FieldProblem
from vsacli.base.units import ANY_SI_UNIT, DIMENSIONLESS, Quantity

if TYPE_CHECKING:
    from vsacli.documents.tree import Node, Scope

REQUIRED = dataclasses.MISSING
LARGEST = 1e30
"""Largest magnitude of a finite number, in SI units: products of a few such numbers do not overflow."""

SMALLEST = 1e-30
"""Smallest magnitude of a number that cannot be zero, since it may be a divisor."""

IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")

FieldPath: TypeAlias = tuple[str | int, ...]
Schema: TypeAlias = dict[str, Any]
Refer: TypeAlias = Callable[[type, str | None], Schema]
"""Function that returns a JSON Schema reference to a record class, or to the variant of a word."""


class Check(NamedTuple):
    """A condition on a single number, and its requirement in words, as in "must be positive".

    `keywords` express it in JSON Schema as far as possible.
    """

    holds: Callable[[float], bool]
    requirement: str
    keywords: Mapping[str, Any] = MappingProxyType({})


_ABOVE_ZERO = {"exclusiveMinimum": 0}
POSITIVE = Check(lambda value: 0 < value < math.inf, "positive", _ABOVE_ZERO)
POSITIVE_OR_INFINITE = Check(lambda value: value > 0, "positive", _ABOVE_ZERO)
NON_NEGATIVE = Check(lambda value: 0 <= value < math.inf, "zero or positive", {"minimum": 0})
NON_ZERO = Check(
    lambda value: value != 0 and abs(value) < math.inf, "finite and not zero", {"not": {"const": 0}}
)
FINITE = Check(lambda value: abs(value) < math.inf, "finite")


class ValueKind:
    """The kind of a declared value.

    Attributes:
        unit: quantity of the numbers; None if there are none, or each has its own unit.
        item: kind of the entries, if a value has several.
        records: classes of the records in a value, by the word that selects each, "" for the only one.
        per_joint: whether the last index of the path to a problem is that of a joint.
        dims: dimensions of a value as one array; None if a value has no array form.
    """

    unit: Quantity | None = None
    item: ValueKind | None = None
    records: Mapping[str, type] = MappingProxyType({})
    per_joint = False
    dims: tuple[str, ...] | None = None


class NumberWithUnit(ValueKind):
    """A number with a unit."""

    unit: Quantity
    dims = ()

    def __init__(self, unit: Quantity) -> None:
        self.unit = unit


class Share(NumberWithUnit):
    """A share such as `3 %` or `0.03`, read as a fraction."""

    def __init__(self) -> None:
        super().__init__(DIMENSIONLESS)


class Integer(ValueKind):
    """A whole number, read as `int`."""


class Boolean(ValueKind):
    """True or false, written as one of these words."""

    dims = ()


class Text(ValueKind):
    """A text; `identifier` restricts it to letters, digits, `_` and `-`, starting with a letter or `_`."""

    dims = ()

    def __init__(self, identifier: bool = False) -> None:
        self.identifier = identifier


class Name(Text):
    """A name for titles, messages and comments in code: one printable line."""


class WordChoice(ValueKind):
    """One of a few words; `words` describes them in the documentation if there are many.

    `not_yet` are words of the format that this version does not support.
    """

    dims = ()

    def __init__(self, options: tuple[str, ...], not_yet: tuple[str, ...] = (), words: str = "") -> None:
        self.options, self.not_yet, self.words = options, not_yet, words


class TablePath(ValueKind):
    """Path of a CSV file, relative to the document, read as a `CsvTable` with these columns."""

    dims = ()

    def __init__(self, columns: tuple[str, ...]) -> None:
        self.columns = columns


class NumberList(ValueKind):
    """A list of `length` numbers, read as a tuple."""

    dims = ("axis",)

    def __init__(self, length: int, unit: Quantity) -> None:
        self.length, self.unit = length, unit
        self.item: NumberWithUnit = NumberWithUnit(unit)


class Interval(ValueKind):
    """An interval `[lower, upper]`, read as a pair; a scalar x means [-x, x], or [`lowest`, x] if given."""

    dims = ("bound",)

    def __init__(self, unit: Quantity, lowest: float | None = None) -> None:
        self.unit, self.lowest = unit, lowest
        self.item: NumberWithUnit = NumberWithUnit(unit)


class NamedNumbers(ValueKind):
    """A mapping from user-defined names to numbers in SI units, read as pairs; angles may be in degrees."""

    number = NumberWithUnit(ANY_SI_UNIT)


class Items(ValueKind):
    """A list of one or more values of a kind, read as a tuple; the text field `unique` must differ in all."""

    item: ValueKind

    def __init__(self, item: ValueKind, unique: str | None = None) -> None:
        self.item, self.unique = item, unique
        self.records, self.per_joint = item.records, item.per_joint


class ItemsByName(Items):
    """A mapping from names, of a `noun`, to records, read as a tuple; each key is the field `name`."""

    def __init__(self, item: ValueKind, noun: str) -> None:
        super().__init__(item, unique="name")
        self.noun = noun


class OneOrMore(Items):
    """One value of a kind, or a list of one or more, read as a tuple."""


class PairOf(ValueKind):
    """One value for both members of a pair, such as the sides of a joint, or a list of two; read as a pair.

    `dim` is the dimension of arrays along which both are stored. Both are the same object if one was written.
    """

    __match_args__ = ("item", "dim")
    item: ValueKind

    def __init__(self, item: ValueKind, dim: str = "motor") -> None:
        self.item, self.dim = item, dim
        self.records, self.unit = item.records, item.unit


class PerJoint(ValueKind):
    """A scalar for all joints, a list, or a mapping by joint name; read as a tuple with one entry a joint.

    Joints exempt from `purpose` are omitted in mappings and null in lists; their entry is None.
    """

    unit: Quantity
    per_joint = True

    def __init__(self, unit: Quantity, purpose: str = "") -> None:
        self.unit, self.purpose = unit, purpose
        self.item: NumberWithUnit = NumberWithUnit(unit)


class RecordOf(ValueKind):
    """A mapping read into the record class `cls`."""

    __match_args__ = ("cls",)

    def __init__(self, cls: type) -> None:
        self.cls, self.records = cls, {"": cls}


class OneOf(ValueKind):
    """A mapping whose key `type` selects the record class; see `WordChoice` for `not_yet`."""

    __match_args__ = ("records",)

    def __init__(self, variants: Mapping[str, type], not_yet: tuple[str, ...] = ()) -> None:
        self.records, self.not_yet = variants, not_yet

    def word_of(self, record: Any) -> str:
        """Return the word that selects the class of a record."""
        return next(word for word, variant in self.records.items() if type(record) is variant)


class OwnKind(ValueKind, ABC):
    """A kind declared by a single module, with all tasks; `words` describe it in the documentation."""

    words: str

    @abstractmethod
    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the value of a node, named `label` in messages; INVALID after noting a problem."""

    def problems(self, _path: FieldPath, _content: Any) -> Iterator[FieldProblem]:
        """Yield the problems of a value at a path."""
        return iter(())

    @abstractmethod
    def schema(self, refer: Refer) -> Schema:
        """Return the JSON Schema of the values."""

    def json_value(self, content: Any, _of_record: Callable[[Any], Any]) -> Any:
        """Return a value in a form that JSON can hold."""
        return content


class Field(NamedTuple):
    """A declared field: the kind of its value, a sentence about it, and the condition on each number."""

    kind: ValueKind
    doc: str
    check: Check | None = None

    @property
    def quantity(self) -> Quantity:
        """Quantity of the numbers; dimensionless if there are none."""
        return self.kind.unit or DIMENSIONLESS


def _collect_fields(cls: type) -> Mapping[str, tuple[Field, Any]]:
    return MappingProxyType(
        {
            attribute.name: (attribute.metadata["field"], attribute.default)
            for attribute in dataclasses.fields(cls)
            if "field" in attribute.metadata
        }
    )


declared_fields: Callable[[type], Mapping[str, tuple[Field, Any]]] = cache(_collect_fields)
"""Function that returns the fields of a record class in file order, each with its default (or REQUIRED)."""


def variant_inside(cls: type, word: Any, variant: str | None) -> str | None:
    """Return the unit variant inside a record.

    Args:
        cls: record class.
        word: content of its field `unit_variant`, None if absent.
        variant: unit variant of the enclosing record.
    """
    selector = getattr(cls, "unit_variant", None)
    if selector is None:
        return variant
    variants = getattr(cls, "unit_variants", None)
    if variants is not None:
        inner_variant: str | None = variants.get(word, variant)
        return inner_variant
    kind = declared_fields(cls)[selector][0].kind
    return str(word) if isinstance(kind, WordChoice) and word in kind.options else None


def _declare(field: Field, default: Any) -> Any:
    return dataclasses.field(default=default, metadata={"field": field}, kw_only=True)


def number(unit: Quantity, doc: str, *, check: Check = FINITE, default: Any = REQUIRED) -> Any:
    """Declare a number."""
    return _declare(Field(NumberWithUnit(unit), doc, check), default)


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
    return _declare(Field(WordChoice(options, not_yet), doc), default)


def vector(length: int, unit: Quantity, doc: str, *, default: Any = REQUIRED) -> Any:
    """Declare a list of finite numbers."""
    return _declare(Field(NumberList(length, unit), doc, FINITE), default)


def interval(unit: Quantity, doc: str, *, lowest: float | None = None, default: Any = REQUIRED) -> Any:
    """Declare an interval; one number x means [-x, x], or [lowest, x] with `lowest`."""
    return _declare(Field(Interval(unit, lowest), doc), default)


def value(kind: ValueKind, doc: str, *, check: Check | None = None, default: Any = REQUIRED) -> Any:
    """Declare a nested value: Record, OneOf, Items, Pair or PerJoint; `check` applies to its numbers."""
    return _declare(Field(kind, doc, check), default)
