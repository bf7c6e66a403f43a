"""What a record class declares: fields, each of a kind, with a sentence about it and a condition on numbers.

A record is a frozen, keyword-only dataclass whose attributes are made by the functions of `fields`. It may
have these class attributes: `not_yet` names keys that belong to the format but that this version does not act
on; `unit_variant` names the choice on which the units in the record, and in records inside it, depend;
`unit_variant_with` is a key and the choice that counts for them if the key is there.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, TypeAlias

from vsacli.base.errors import FieldProblem, InvalidRecordError
from vsacli.base.units import DIMENSIONLESS, Quantity
from vsacli.documents.resolved_fields import ResolvedField
from vsacli.documents.tree import Node, Scope

REQUIRED = dataclasses.MISSING
LARGEST = 1e30
"""Size of a finite number, in SI units, beyond which it is refused: products of a few still are numbers."""

SMALLEST = 1e-30
"""Size below which a number is refused if it cannot be zero: one may divide by it."""

FieldPath: TypeAlias = tuple[str | int, ...]
Schema: TypeAlias = dict[str, Any]
Values: TypeAlias = Mapping[str, Any]
"""Values to be written, by key: numbers, texts, lists of them, and such mappings for records."""


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
        if LARGEST < abs(number) < math.inf:
            return f"must be at most {LARGEST:g} in size, not {number:g}"
        if 0 < abs(number) < SMALLEST and not self.holds(0.0):
            return f"must be at least {SMALLEST:g} in size, not {number:g}"
        return None


_ANY = Check(lambda _: True, "any number")


class Line(NamedTuple):
    """A line of a document to be written: its text, a comment on it, and whether a reader sees it."""

    text: str
    comment: str = ""
    active: bool = True

    def inside(self, indent: str = "  ") -> Line:
        """The line, farther to the right."""
        return self._replace(text=indent + self.text)

    def inactive(self) -> Line:
        """The line, commented out."""
        return self._replace(active=False)


Refer: TypeAlias = Callable[[type, str | None], Schema]
LinesOfRecord: TypeAlias = Callable[[type, Values], Iterator[Line]]
ArraysOfRecord: TypeAlias = Callable[[Any], Iterator[ResolvedField]]
JsonOfRecord: TypeAlias = Callable[[Any], Any]


class Kind(ABC):
    """What a value may look like in a file: everything that is done with a declared value goes by its kind.

    Callers hand in what they do with a record, for kinds that hold records.

    Attributes:
        marks: what follows the key of a list in paths that are shown.
    """

    marks: ClassVar[str] = ""

    @property
    def records(self) -> Mapping[str, type]:
        """Classes of the records in a value, by the word that selects each, "" for the only one."""
        return {}

    @property
    def each(self) -> Kind | None:
        """The kind of the entries, if a value has several."""
        return None

    @property
    def per_joint(self) -> bool:
        """Whether the last index of the path to a problem is that of a joint."""
        return False

    @property
    def forms(self) -> str:
        """What may be written where it cannot be guessed, a clause in parentheses."""
        return ""

    @abstractmethod
    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """The value of a node, which messages call `label`; INVALID if its problem was noted."""

    @abstractmethod
    def schema(self, check: Check | None, refer: Refer, /) -> Schema:
        """JSON Schema of values whose numbers meet a condition.

        Args:
            check: the condition.
            refer: gives the schema that refers to a record class, as the variant of a word if it is one.
        """

    @property
    @abstractmethod
    def words(self) -> str:
        """What a value is, in a few words with its unit."""

    def problems(self, path: FieldPath, check: Check | None, content: Any, /) -> Iterator[FieldProblem]:
        """What is wrong with a value at a path, whose numbers must meet a condition."""
        yield from _number_problems(path, check, content)

    def refused(self, _name: str, /) -> Iterator[str]:
        """What the format has in a field of the name, but this version does not act on."""
        return iter(())

    def lines(self, name: str, value: Any, comment: str, _of_record: LinesOfRecord, /) -> Iterator[Line]:
        """A field in a commented document, from a value as in a file; `of_record` gives those of a record."""
        yield Line(f"{name}: {on_one_line(value)}", comment)

    def arrays(self, _content: Any, _of_record: ArraysOfRecord, /) -> Iterator[ResolvedField]:
        """A value as arrays.

        Raises:
            TypeError: there are none of this kind.
        """
        raise TypeError(f"a field of the kind {self} has no array form")

    def json_value(self, content: Any, _of_record: JsonOfRecord, /) -> Any:
        """A value as JSON could hold it, but for numbers that are not finite."""
        return content

    def names(self, content: Any, _members: Mapping[str, str], /) -> list[str]:
        """Names of the entries, "" where one has none; `_members` are the joints, where they have values."""
        return [""] * len(content)


def on_one_line(value: Any) -> str:
    """A value as YAML on one line."""
    match value:
        case Mapping():
            return f"{{{', '.join(f'{key}: {on_one_line(entry)}' for key, entry in value.items())}}}"
        case list() | tuple():
            return f"[{', '.join(map(on_one_line, value))}]"
        case bool():
            return "true" if value else "false"
        case None:
            return "null"
        case float():
            return f"{value:.10g}"
    return str(value)


def _number_problems(path: FieldPath, check: Check | None, content: Any) -> Iterator[FieldProblem]:
    """What is wrong with the numbers in a value, which may be tuples of them; other values pass."""
    if isinstance(content, tuple):
        for index, item in enumerate(content):
            yield from _number_problems((*path, index), check, item)
    elif (check is not None and content is not None) or isinstance(content, float | int):
        problem = (check or _ANY).problem(content)
        if problem:
            yield FieldProblem(path, problem)


class Field(NamedTuple):
    """A declared field: the kind of its value, one sentence about it, and the condition on each number."""

    kind: Kind
    doc: str
    check: Check | None = None

    @property
    def quantity(self) -> Quantity:
        """What its numbers measure."""
        quantity: Quantity = getattr(self.kind, "unit", DIMENSIONLESS)
        return quantity

    def problems(self, name: str, content: Any) -> Iterator[FieldProblem]:
        """What is wrong with the content of the field, whose name is given."""
        return self.kind.problems((name,), self.check, content)


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
        for problem in field.problems(name, getattr(record, name))
    ]
    if problems or further:
        raise InvalidRecordError(type(record).__name__, [*problems, *further])
