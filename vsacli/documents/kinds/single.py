"""Values that are one: a number, a whole number, true or false, a text, a word, a file."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import FieldProblem, InputError
from vsacli.base.texts import MOST_LETTERS
from vsacli.base.units import DIMENSIONLESS, Quantity
from vsacli.documents.expression import ExpressionError
from vsacli.documents.number import ANGLES, BOOLEANS, MAX_LENGTH, evaluate
from vsacli.documents.records import (
    LARGEST,
    ArraysOfRecord,
    Check,
    FieldPath,
    JsonOfRecord,
    Kind,
    Refer,
    Schema,
    on_one_line,
)
from vsacli.documents.resolved_fields import ResolvedField, single
from vsacli.documents.tree import INVALID, Node, Scalar, Scope, quoted

IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
EXPRESSION = r"^[ \t]*[-+(.0-9p][-+*/(). \t0-9eEpi]*$"
ANGLE = r"^[ \t]*[-+(.0-9p][-+*/(). \t0-9eEpi]*(deg)?[ \t]*$"
"""How expressions look, for JSON Schema."""

TRUTHS = ("true", "false")

PRINTABLE = r"^[^\x00-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]+$"
"""How names look, for JSON Schema."""


@dataclass(eq=False)
class Number(Kind):
    """One number with a unit."""

    unit: Quantity

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """The number in SI units."""
        return read_number(node, scope.unit(self.unit), label, scope)

    def schema(self, check: Check | None, _refer: Refer, /) -> Schema:
        """A number within the bounds, or an expression."""
        keywords = {"minimum": -LARGEST, "maximum": LARGEST, **({} if check is None else check.keywords)}
        pattern = ANGLE if {self.unit.revolute, self.unit.prismatic} & set(ANGLES) else EXPRESSION
        return {"anyOf": [{"type": "number", **keywords}, _expression(pattern)]}

    @property
    def words(self) -> str:
        """Its unit."""
        return unit_words(self.unit)

    def arrays(self, content: Any, _of_record: ArraysOfRecord, /) -> Iterator[ResolvedField]:
        """A single number."""
        yield single((), self.unit, float(content))


def read_number(node: Node, unit: str, label: str, scope: Scope) -> Any:
    """The number of a node with a unit."""
    expected = "a number" if unit == str(DIMENSIONLESS) else f"a number in {unit}"
    if not isinstance(node, Scalar) or node.is_null:
        return scope.unexpected(node, expected, label)
    try:
        return evaluate(node.text, unit)
    except ExpressionError as error:
        return scope.unexpected(node, expected, label, f": {error}")


def unit_words(unit: Quantity) -> str:
    """A unit, or that it is a number."""
    return "number" if unit == DIMENSIONLESS else str(unit)


def _expression(pattern: str) -> Schema:
    return {"type": "string", "pattern": pattern, "maxLength": MAX_LENGTH}


@dataclass(eq=False)
class Integer(Kind):
    """One whole number."""

    words = "whole number"

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """The number as `int`."""
        value = read_number(node, str(DIMENSIONLESS), label, scope)
        if value is INVALID or value.is_integer():
            return value if value is INVALID else int(value)
        return scope.unexpected(node, "a whole number", label)

    def schema(self, check: Check | None, _refer: Refer, /) -> Schema:
        """A whole number, or an expression."""
        keywords = {} if check is None else check.keywords
        return {"anyOf": [{"type": "integer", **keywords}, _expression(EXPRESSION)]}


@dataclass(eq=False)
class Boolean(Kind):
    """True or false, by these words alone."""

    words = "`true` or `false`"

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """The value as `bool`."""
        if isinstance(node, Scalar) and node.plain and node.text in TRUTHS:
            return node.text == "true"
        return scope.unexpected(node, "true or false", label)

    def problems(self, path: FieldPath, _check: Check | None, content: Any, /) -> Iterator[FieldProblem]:
        """Anything else."""
        if not isinstance(content, bool):
            yield FieldProblem(path, f"must be true or false, not {content!r}")

    def schema(self, _check: Check | None, _refer: Refer, /) -> Schema:
        """True or false."""
        return {"type": "boolean"}

    def arrays(self, content: Any, _of_record: ArraysOfRecord, /) -> Iterator[ResolvedField]:
        """A single text, since some readers of HDF5 know no boolean."""
        yield single((), None, on_one_line(content))


@dataclass(eq=False)
class Text(Kind):
    """A text; `identifier` restricts it to letters, digits, `_` and `-`, starting with a letter or `_`."""

    identifier: bool = False

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """The text as written, unless YAML takes it for something else."""
        if not isinstance(node, Scalar) or node.is_null:
            return scope.unexpected(node, "a text", label)
        if node.plain and node.text.lower() in BOOLEANS:
            return scope.unexpected(node, "a text", label, ", a boolean in YAML; put it in quotes")
        return node.text

    def problems(self, path: FieldPath, _check: Check | None, content: Any, /) -> Iterator[FieldProblem]:
        """Characters that an identifier, or any text, cannot have."""
        if self.identifier and not IDENTIFIER.fullmatch(content):
            requirement = "letters, digits, _ and -, beginning with a letter or _"
            yield FieldProblem(path, f"must be made of {requirement}, not {quoted(content)}")
        else:
            yield from _unprintable(path, content, allowed="\n")

    def schema(self, _check: Check | None, _refer: Refer, /) -> Schema:
        """A string; a number if any text will do, which YAML may take it for."""
        if self.identifier:
            return {"type": "string", "pattern": f"^{IDENTIFIER.pattern}$"}
        return {"type": ["string", "number"]}

    @property
    def words(self) -> str:
        """Which texts."""
        return "text of letters, digits, `_` and `-`" if self.identifier else "text"

    def arrays(self, content: Any, _of_record: ArraysOfRecord, /) -> Iterator[ResolvedField]:
        """A single text."""
        yield single((), None, content)


@dataclass(eq=False)
class Name(Text):
    """A name, which stands in titles, messages and comments of code: one line that can be printed."""

    words = f"text in one line, of at most {MOST_LETTERS} letters"

    def problems(self, path: FieldPath, _check: Check | None, content: Any, /) -> Iterator[FieldProblem]:
        """Nothing, too much, or letters that cannot be printed."""
        if not 1 <= len(content) <= MOST_LETTERS:
            yield FieldProblem(path, f"must have 1 to {MOST_LETTERS} letters, not {len(content)}")
        yield from _unprintable(path, content)

    def schema(self, _check: Check | None, _refer: Refer, /) -> Schema:
        """A string, or a number which YAML may take it for."""
        lengths = {"minLength": 1, "maxLength": MOST_LETTERS}
        return {"type": ["string", "number"], **lengths, "pattern": PRINTABLE}


def _unprintable(path: FieldPath, content: str, *, allowed: str = "") -> Iterator[FieldProblem]:
    """Control characters, and those that turn the direction of writing."""
    for letter in content:
        if not (letter.isprintable() or letter in allowed):
            what = "has a line break" if letter == "\n" else f"has the character {letter!r}"
            yield FieldProblem(path, f"{what}, which cannot be printed in one line; remove it")
            return


@dataclass(eq=False)
class Choice(Kind):
    """One of a few words; `not_yet` are words of the format that this version does not act on."""

    options: tuple[str, ...]
    not_yet: tuple[str, ...] = ()

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """The word, which may still be none of the options."""
        if isinstance(node, Scalar) and not node.is_null:
            return node.text
        return scope.unexpected(node, f"one of {', '.join(self.options)}", label)

    def problems(self, path: FieldPath, _check: Check | None, content: Any, /) -> Iterator[FieldProblem]:
        """Another word."""
        if content not in self.options:
            yield FieldProblem(path, unknown_word(content, self.options, self.not_yet))

    def refused(self, name: str, /) -> Iterator[str]:
        """The words that are not supported yet."""
        yield from (f"{name}: {word}" for word in self.not_yet)

    def schema(self, _check: Check | None, _refer: Refer, /) -> Schema:
        """One of the options."""
        return {"enum": list(self.options)}

    @property
    def words(self) -> str:
        """The options."""
        return " or ".join(f"`{option}`" for option in self.options)

    @property
    def forms(self) -> str:
        """The options."""
        return f" ({' or '.join(self.options)})"

    def arrays(self, content: Any, _of_record: ArraysOfRecord, /) -> Iterator[ResolvedField]:
        """A single word."""
        yield single((), None, content)


def unknown_word(word: str, options: Iterable[str], not_yet: tuple[str, ...]) -> str:
    """Why a word is none of the options."""
    if word in not_yet:
        return f"{word!r} is not supported yet"
    return f"unknown word {quoted(word)}{did_you_mean(word, options)}"


@dataclass(eq=False)
class TableFile(Kind):
    """Path of a CSV file relative to the document, read as a `Table` of these columns."""

    columns: tuple[str, ...]

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """The table in the file; what is wrong with that is noted under its own name."""
        name = Text().read(node, label, scope)
        if name is INVALID:
            return INVALID
        from vsacli.documents.table import read_table

        try:
            table = read_table(Path(scope.problems.file).parent / name)
            if table.columns != self.columns:
                expected, found = ",".join(self.columns), ",".join(table.columns)
                message = f"expected the header {expected}, found {found}"
                raise InputError.one(message, table.source.path, 1)
        except InputError as error:
            scope.problems.include(error)
            return INVALID
        return table

    def schema(self, _check: Check | None, _refer: Refer, /) -> Schema:
        """A string."""
        return {"type": "string"}

    @property
    def words(self) -> str:
        """The columns."""
        return f"CSV file with the columns {', '.join(f'`{column}`' for column in self.columns)}"

    def arrays(self, content: Any, _of_record: ArraysOfRecord, /) -> Iterator[ResolvedField]:
        """The path of the file."""
        yield single((), None, content.source.path)

    def json_value(self, content: Any, _of_record: JsonOfRecord, /) -> Any:
        """The path of the file."""
        return content.source.path
