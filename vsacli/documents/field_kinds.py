"""Kinds of declared values: numbers with units, texts, words, files, and several numbers.

A kind holds the data of a declared value (unit, length, options) and reads it from a node of a document. Each
further task is one function for all kinds: JSON Schema in `json_schema`, lines of a template in `commented`,
arrays, JSON values and numbers in `record_values`. Lists and records are in `nested`.

A record class is a frozen, keyword-only dataclass whose attributes are made by the functions of `fields`. It
may have these class attributes: `not_yet` names keys of the format that this version does not support;
`unit_variant` names the choice that determines the units in the record and in nested records; `unit_variants`
maps its words to unit variants, and words without one keep that of the enclosing record (without the mapping,
the words are the variants); `required_unless` maps a key to another one and a number: the first is required
with the second unless that has this number.
"""

from __future__ import annotations

import dataclasses
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import FieldProblem, InputError, InvalidRecordError
from vsacli.base.texts import MOST_LETTERS
from vsacli.base.units import ANY_SI_UNIT, DIMENSIONLESS, Quantity
from vsacli.documents import tree
from vsacli.documents.expression import ExpressionError
from vsacli.documents.number import BOOLEANS, evaluate, expected_number
from vsacli.documents.tree import INVALID, Node, Scalar, Scope, all_valid, quoted

REQUIRED = dataclasses.MISSING
LARGEST = 1e30
"""Largest magnitude of a finite number, in SI units: products of a few such numbers do not overflow."""

SMALLEST = 1e-30
"""Smallest magnitude of a number that cannot be zero, since it may be a divisor."""

IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
TRUTHS = ("true", "false")

PER_CENT = re.compile(r"(?P<number>.*\S)\s*%")
"""Regular expression of a share in percent."""

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

    def problem(self, number: float) -> str | None:
        """Return why a number is refused, by the condition or for its magnitude; None if it is valid."""
        if not self.holds(number):
            return f"must be {self.requirement}, not {number:g}"
        if LARGEST < abs(number) < math.inf:
            return f"must be at most {LARGEST:g} in size, not {number:g}"
        if 0 < abs(number) < SMALLEST and not self.holds(0.0):
            return f"must be at least {SMALLEST:g} in size, not {number:g}"
        return None


_WITHOUT_UNIT = {str(DIMENSIONLESS), str(ANY_SI_UNIT)}
_ANY = Check(lambda _: True, "any number")


class Kind(ABC):
    """The kind of a declared value.

    Attributes:
        unit: quantity of the numbers; None if there are none, or each has its own unit.
        item: kind of the entries, if a value has several.
        records: classes of the records in a value, by the word that selects each, "" for the only one.
        per_joint: whether the last index of the path to a problem is that of a joint.
        dims: dimensions of a value as one array; None if a value has no array form.
    """

    unit: Quantity | None = None
    item: Kind | None = None
    records: Mapping[str, type] = MappingProxyType({})
    per_joint = False
    dims: tuple[str, ...] | None = None

    @abstractmethod
    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the value of a node, named `label` in messages; INVALID after noting a problem."""

    def fault(self, _content: Any) -> str | None:
        """Return the problem of a value as a whole, apart from the condition on its numbers, or None."""
        return None

    def problems(self, path: FieldPath, check: Check | None, content: Any) -> Iterator[FieldProblem]:
        """Yield the problems of a value at a path; its numbers must meet the condition."""
        fault = self.fault(content)
        if fault is not None:
            yield self._problem(path, fault)
        elif isinstance(content, tuple):
            for index, entry in enumerate(content):
                yield from (self.item or self).problems((*path, index), check, entry)
        elif content is not None and (check or (self.unit and isinstance(content, float | int))):
            problem = (check or _ANY).problem(content)
            if problem:
                yield self._problem(path, f"{problem} {{}}" if self._has_unit else problem)

    @property
    def _has_unit(self) -> bool:
        """Whether numbers have a unit to show after them, at joints of any type."""
        return self.unit is not None and _WITHOUT_UNIT.isdisjoint((self.unit.revolute, self.unit.prismatic))

    def _problem(self, path: FieldPath, message: str) -> FieldProblem:
        """Return a problem; each `{}` in the message stands for the unit."""
        quantities = (self.unit,) * message.count("{}") if self.unit is not None else ()
        return FieldProblem(path, message, quantities=quantities)


class OwnKind(Kind):
    """A kind declared by a single module; `words` describe it in the documentation."""

    words: str

    @abstractmethod
    def schema(self, refer: Refer) -> Schema:
        """Return the JSON Schema of the values."""

    def json_value(self, content: Any, _of_record: Callable[[Any], Any]) -> Any:
        """Return a value in a form that JSON can hold."""
        return content


class Field(NamedTuple):
    """A declared field: the kind of its value, a sentence about it, and the condition on each number."""

    kind: Kind
    doc: str
    check: Check | None = None

    @property
    def quantity(self) -> Quantity:
        """Quantity of the numbers; dimensionless if there are none."""
        return self.kind.unit or DIMENSIONLESS

    def problems(self, name: str, content: Any) -> Iterator[FieldProblem]:
        """Yield the problems of the content of a field, by its name."""
        return self.kind.problems((name,), self.check, content)


def declared(cls: type) -> dict[str, tuple[Field, Any]]:
    """Return the fields of a record class in file order, each with its default (REQUIRED if it has none)."""
    return {
        attribute.name: (attribute.metadata["field"], attribute.default)
        for attribute in dataclasses.fields(cls)
        if "field" in attribute.metadata
    }


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
        known: str | None = variants.get(word, variant)
        return known
    kind = declared(cls)[selector][0].kind
    return str(word) if isinstance(kind, Choice) and word in kind.options else None


def check_fields(record: Any, *further: FieldProblem) -> None:
    """Check every declared field of a record; for `__post_init__`.

    Args:
        record: instance of a record class.
        further: problems found by the record itself, to be reported together.

    Raises:
        InvalidRecordError: with each invalid field.
    """
    problems = [
        problem
        for name, (field, default) in declared(type(record)).items()
        if not (default is None and getattr(record, name) is None)
        for problem in field.problems(name, getattr(record, name))
    ]
    if problems or further:
        raise InvalidRecordError(type(record).__name__, [*problems, *further])


class Number(Kind):
    """A number with a unit."""

    unit: Quantity
    dims = ()

    def __init__(self, unit: Quantity) -> None:
        self.unit = unit

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the number in SI units."""
        return read_number(node, scope.unit(self.unit), label, scope)


def read_number(node: Node, unit: str, label: str, scope: Scope) -> Any:
    """Return the number of a node in a unit; see `Kind.read`."""
    if not isinstance(node, Scalar) or node.is_null:
        return scope.unexpected(node, expected_number(unit), label)
    try:
        return evaluate(node.text, unit)
    except ExpressionError as error:
        scope.problems.add(node.line, f"{label}: {error}")
        return INVALID


class Share(Number):
    """A share such as `3 %` or `0.03`."""

    def __init__(self) -> None:
        super().__init__(DIMENSIONLESS)

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the share as a fraction."""
        share = PER_CENT.fullmatch(node.text) if isinstance(node, Scalar) else None
        if share is None:
            return super().read(node, label, scope)
        number = super().read(Scalar(node.line, share["number"], plain=True), label, scope)
        return number if number is INVALID else number / 100


class Integer(Kind):
    """A whole number."""

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the number as `int`."""
        value = read_number(node, str(DIMENSIONLESS), label, scope)
        if value is INVALID or value.is_integer():
            return value if value is INVALID else int(value)
        return scope.unexpected(node, "a whole number", label)


class Boolean(Kind):
    """True or false, written as one of these words."""

    dims = ()

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the value as `bool`."""
        if isinstance(node, Scalar) and node.plain and node.text in TRUTHS:
            return node.text == "true"
        return scope.unexpected(node, "true or false", label)

    def fault(self, content: Any) -> str | None:
        """See `Kind.fault`."""
        return None if isinstance(content, bool) else f"must be true or false, not {content!r}"


class Text(Kind):
    """A text; `identifier` restricts it to letters, digits, `_` and `-`, starting with a letter or `_`."""

    dims = ()

    def __init__(self, identifier: bool = False) -> None:
        self.identifier = identifier

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the text as written, unless YAML reads it as another type."""
        if not isinstance(node, Scalar) or node.is_null:
            return scope.unexpected(node, "a text", label)
        if node.plain and node.text.lower() in BOOLEANS:
            return scope.unexpected(node, "a text", label, ", a boolean in YAML; put it in quotes")
        return node.text

    def fault(self, content: Any) -> str | None:
        """See `Kind.fault`."""
        if self.identifier and not IDENTIFIER.fullmatch(content):
            requirement = "letters, digits, _ and -, beginning with a letter or _"
            return f"must be made of {requirement}, not {quoted(content)}"
        return _unprintable(content, allowed="\n")


class Name(Text):
    """A name for titles, messages and comments in code: one printable line."""

    def fault(self, content: Any) -> str | None:
        """See `Kind.fault`."""
        if not 1 <= len(content) <= MOST_LETTERS:
            return f"must have 1 to {MOST_LETTERS} letters, not {len(content)}"
        return _unprintable(content)


def _unprintable(content: str, allowed: str = "") -> str | None:
    """Return the problem of a text with control characters or writing-direction marks; None without one."""
    for letter in content:
        if not (letter.isprintable() or letter in allowed):
            what = "has a line break" if letter == "\n" else f"has the character {letter!r}"
            return f"{what}, which cannot be printed in one line; remove it"
    return None


class Choice(Kind):
    """One of a few words; `words` describes them in the documentation if there are many.

    `not_yet` are words of the format that this version does not support.
    """

    dims = ()

    def __init__(self, options: tuple[str, ...], not_yet: tuple[str, ...] = (), words: str = "") -> None:
        self.options, self.not_yet, self.words = options, not_yet, words

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the word; `fault` checks whether it is an option."""
        if isinstance(node, Scalar) and not node.is_null:
            return node.text
        return scope.unexpected(node, f"one of {', '.join(self.options)}", label)

    def fault(self, content: Any) -> str | None:
        """See `Kind.fault`."""
        return None if content in self.options else unknown_word(content, self.options, self.not_yet)


def unknown_word(word: str, options: Iterable[str], not_yet: tuple[str, ...]) -> str:
    """Return the problem of a word that is not among the options."""
    if word in not_yet:
        return f"{word!r} is not supported yet"
    return f"unknown word {quoted(word)}{did_you_mean(word, options)}"


class TableFile(Kind):
    """Path of a CSV file, relative to the document, read as a `Table` with these columns."""

    dims = ()

    def __init__(self, columns: tuple[str, ...]) -> None:
        self.columns = columns

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the table in the file; its problems are noted under the name of that file."""
        name = Text().read(node, label, scope)
        if name is INVALID:
            return INVALID
        from vsacli.documents.table import read_table

        try:
            table = read_table(Path(scope.problems.file).parent / name)
            if table.columns != self.columns:
                message = f"expected the header {','.join(self.columns)}, found {','.join(table.columns)}"
                raise InputError.one(message, table.source.path, 1)
        except InputError as error:
            scope.problems.include(error)
            return INVALID
        return table


class Vector(Kind):
    """A list of `length` numbers, read as a tuple."""

    dims = ("axis",)

    def __init__(self, length: int, unit: Quantity) -> None:
        self.length, self.unit = length, unit
        self.item: Number = Number(unit)

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the numbers; `fault` checks how many there are."""
        if not isinstance(node, tree.Sequence):
            return scope.unexpected(node, f"a list of {self.length} numbers in {self.unit}", label)
        return all_valid(self.item.read(item, label, scope) for item in node.items)

    def fault(self, content: Any) -> str | None:
        """See `Kind.fault`."""
        found = len(content)
        return None if found == self.length else f"expected {self.length} numbers in {{}}, found {found}"


class Interval(Kind):
    """An interval `[lower, upper]`, read as a pair; a scalar x means [-x, x], or [`lowest`, x] if given."""

    dims = ("bound",)

    def __init__(self, unit: Quantity, lowest: float | None = None) -> None:
        self.unit, self.lowest = unit, lowest
        self.item: Number = Number(unit)

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return both bounds."""
        if isinstance(node, tree.Scalar):
            upper = self.item.read(node, label, scope)
            return upper if upper is INVALID else (-upper if self.lowest is None else self.lowest, upper)
        if isinstance(node, tree.Sequence) and len(node.items) == 2:
            return all_valid(self.item.read(item, label, scope) for item in node.items)
        return scope.unexpected(node, "[lower, upper] or one number", label)

    def fault(self, content: Any) -> str | None:
        """See `Kind.fault`."""
        if content[0] <= content[1]:
            return None
        unit = " {}" if self._has_unit else ""
        return f"the lower limit {content[0]:g}{unit} exceeds the upper limit {content[1]:g}{unit}; swap them"


class NamedNumbers(Kind):
    """A mapping from user-defined names to numbers in SI units, read as pairs; angles may be in degrees."""

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return pairs of name and number."""
        if not isinstance(node, tree.Mapping):
            return scope.unexpected(node, "a mapping from names to numbers", label)
        numbers = all_valid(
            read_number(entry, str(ANY_SI_UNIT), f"{label}.{name}", scope)
            for name, entry in node.entries.items()
        )
        return numbers if numbers is INVALID else tuple(zip(node.entries, numbers, strict=True))

    def problems(self, path: FieldPath, check: Check | None, content: Any) -> Iterator[FieldProblem]:
        """See `Kind.problems`."""
        for name, entry in content:
            yield from Number(ANY_SI_UNIT).problems((*path, name), check, entry)
