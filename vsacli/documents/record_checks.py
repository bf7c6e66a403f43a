"""Checks of declared values, the same for files and for constructors: each field by itself, then the record.

The reader of a file checks where the lines are known, and constructs records that are not checked again.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from itertools import chain
from typing import Any, Self, TypeVar

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import FieldProblem, InvalidRecordError
from vsacli.base.texts import MOST_LETTERS
from vsacli.base.units import ANY_SI_UNIT, DIMENSIONLESS
from vsacli.documents.fields import (
    IDENTIFIER,
    LARGEST,
    SMALLEST,
    Boolean,
    Check,
    Field,
    FieldPath,
    Interval,
    Items,
    Name,
    NamedNumbers,
    NumberList,
    OwnKind,
    PairOf,
    Text,
    ValueKind,
    WordChoice,
    declared_fields,
)
from vsacli.documents.tree import quoted

_Record = TypeVar("_Record", bound="DeclaredRecord")

_ANY = Check(lambda _: True, "any number")
_WITHOUT_UNIT = {str(DIMENSIONLESS), str(ANY_SI_UNIT)}


class DeclaredRecord:
    """A record of declared fields, a frozen dataclass that its constructor checks.

    Raises:
        InvalidRecordError: with each invalid field, or else with the problems of the record as a whole.
    """

    def __post_init__(self) -> None:
        _refuse(self, field_problems(type(self), vars(self)))
        _refuse(self, self._problems())

    @classmethod
    def of_valid_fields(cls, values: Mapping[str, Any]) -> Self:
        """Return the record of values that were checked each by itself, by a reader that knows their lines.

        Raises:
            InvalidRecordError: the values do not go together.
            InputError: a file that the record refers to has problems.
        """
        record = construct_unchecked(cls, values)
        _refuse(record, record._problems())
        return record

    def with_fields(self, contents: Mapping[str, Any]) -> Self:
        """Return the record with other values of some fields; the rest, which was checked, is not again.

        Raises:
            InvalidRecordError: a value is invalid, or does not go with the others.
        """
        record = replaced_unchecked(self, contents)
        fields = declared_fields(type(self))
        problems_by_field = (
            _problems_of_field(fields[name], name, content) for name, content in contents.items()
        )
        _refuse(record, chain.from_iterable(problems_by_field))
        _refuse(record, record._problems())
        return record

    def _problems(self) -> Iterable[FieldProblem]:
        """Return the problems between fields, each of which is valid by itself.

        Subclasses state their conditions here: in `__post_init__`, a reader of files would not ask for them.
        """
        return ()


def _refuse(record: DeclaredRecord, problems: Iterable[FieldProblem]) -> None:
    if problem_list := list(problems):
        raise InvalidRecordError(type(record).__name__, problem_list)


def construct_unchecked(cls: type[_Record], values: Mapping[str, Any]) -> _Record:
    """Return a record of values that need no check, such as checked ones or duals, and of defaults."""
    record = object.__new__(cls)
    vars(record).update(_defaults(cls), **values)
    return record


def replaced_unchecked(record: _Record, contents: Mapping[str, Any]) -> _Record:
    """Return a record with other values in some fields, without its checks and cached values."""
    values = {name: getattr(record, name) for name in _defaults(type(record))}
    return construct_unchecked(type(record), {**values, **contents})


_defaults: Callable[[type], Mapping[str, Any]] = cache(
    lambda cls: {attribute.name: attribute.default for attribute in dataclasses.fields(cls)}
)


def field_problems(cls: type, values: Mapping[str, Any]) -> Iterator[FieldProblem]:
    """Yield the problems of each field of a record by itself; fields without a value have none."""
    for name, declared in declared_fields(cls).items():
        if name in values:
            yield from _problems_of_field(declared, name, values[name])


def _problems_of_field(declared: tuple[Field, Any], name: str, content: Any) -> Iterator[FieldProblem]:
    field, default = declared
    if not (content is None and default is None):
        yield from value_problems(field.kind, field.check, content, (name,))


def value_problems(
    kind: ValueKind, check: Check | None, content: Any, path: FieldPath
) -> Iterator[FieldProblem]:
    """Yield the problems of a value at a path; its numbers must meet the condition."""
    fault = fault_of(kind, content)
    if fault is not None:
        yield _problem_in_units(kind, path, fault)
    elif isinstance(kind, OwnKind):
        yield from kind.problems(path, content)
    elif isinstance(kind, Items) and kind.unique is not None:  # of records, which are checked
        yield from _repeated_entries(kind.unique, content, path)
    elif isinstance(kind, NamedNumbers):
        for name, entry in content:
            yield from _number_problems(kind.number, check, entry, (*path, name))
    elif isinstance(content, tuple) or isinstance(kind, Items | PairOf):
        for index, entry in enumerate(content):
            yield from value_problems(kind.item or kind, check, entry, (*path, index))
    else:
        yield from _number_problems(kind, check, content, path)


def _number_problems(
    kind: ValueKind, check: Check | None, content: Any, path: FieldPath
) -> Iterator[FieldProblem]:
    """Yield the problem of a single value, if it is a number that does not meet the condition."""
    if content is None or not (check or (kind.unit and isinstance(content, float | int))):
        return
    fault = fault_of_number(content, check or _ANY)
    if fault:
        yield _problem_in_units(kind, path, f"{fault} {{}}" if _has_unit(kind) else fault)


def _repeated_entries(key: str, content: Iterable[Any], path: FieldPath) -> Iterator[FieldProblem]:
    """Yield a problem for each entry of a list whose text under a key occurred before."""
    words = [getattr(entry, key) for entry in content]
    for index, first_index in repetitions(words):
        yield FieldProblem((*path, index, key), already_used(words[index], f"by entry {first_index}"))


def _has_unit(kind: ValueKind) -> bool:
    """Return whether numbers have a unit to show after them, at joints of any type."""
    return kind.unit is not None and _WITHOUT_UNIT.isdisjoint((kind.unit.revolute, kind.unit.prismatic))


def _problem_in_units(kind: ValueKind, path: FieldPath, message: str) -> FieldProblem:
    """Return a problem; each `{}` in the message stands for the unit."""
    quantities = (kind.unit,) * message.count("{}") if kind.unit is not None else ()
    return FieldProblem(path, message, quantities=quantities)


def repetitions(words: Iterable[str | None]) -> Iterator[tuple[int, int]]:
    """Yield the index of each word that occurred before, and that of its first occurrence; skip None."""
    first_indices: dict[str, int] = {}
    for index, word in enumerate(words):
        if word is not None and first_indices.setdefault(word, index) != index:
            yield index, first_indices[word]


def already_used(word: str, where: str) -> str:
    """Return the problem of a word that must be unique and is not."""
    return f"{quoted(word)} is already used {where}; choose another one"


def fault_of(kind: ValueKind, content: Any) -> str | None:
    """Return the problem of a value as a whole, apart from the condition on its numbers, or None."""
    match kind:
        case Boolean() if not isinstance(content, bool):
            return f"must be true or false, not {content!r}"
        case Name() if not 1 <= len(content) <= MOST_LETTERS:
            return f"must have 1 to {MOST_LETTERS} letters, not {len(content)}"
        case Text(identifier=True) if not IDENTIFIER.fullmatch(content):
            requirement = "letters, digits, _ and -, beginning with a letter or _"
            return f"must be made of {requirement}, not {quoted(content)}"
        case Text():
            return _unprintable(content, allowed="" if isinstance(kind, Name) else "\n")
        case WordChoice(options=options) if content not in options:
            return unknown_word(content, options, kind.not_yet)
        case NumberList(length=length) if len(content) != length:
            return f"expected {length} numbers in {{}}, found {len(content)}"
        case Interval() if not content[0] <= content[1]:
            (lower, upper), unit = content, " {}" if _has_unit(kind) else ""
            return f"the lower limit {lower:g}{unit} exceeds the upper limit {upper:g}{unit}; swap them"
    return None


def _unprintable(content: str, allowed: str) -> str | None:
    """Return the problem of a text with control characters or writing-direction marks; None without one."""
    for letter in content:
        if not (letter.isprintable() or letter in allowed):
            fault = "has a line break" if letter == "\n" else f"has the character {letter!r}"
            return f"{fault}, which cannot be printed in one line; remove it"
    return None


def unknown_word(word: str, options: Iterable[str], not_yet: tuple[str, ...]) -> str:
    """Return the problem of a word that is not among the options."""
    if word in not_yet:
        return f"{word!r} is not supported yet"
    return f"unknown word {quoted(word)}{did_you_mean(word, options)}"


def fault_of_number(number: float, check: Check) -> str | None:
    """Return why a number is refused, by the condition or for its magnitude; None if it is valid."""
    if not check.holds(number):
        return f"must be {check.requirement}, not {number:g}"
    if LARGEST < abs(number) < math.inf:
        return f"must be at most {LARGEST:g} in size, not {number:g}"
    if 0 < abs(number) < SMALLEST and not check.holds(0.0):
        return f"must be at least {SMALLEST:g} in size, not {number:g}"
    return None
