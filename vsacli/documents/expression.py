"""Expressions in documents: one grammar for formulas, for numbers such as `pi/2`, and for units.

The reader of a document defines the vocabulary. Texts are never evaluated by Python, and length and nesting
are limited, so that malicious input cannot exhaust memory or stack. Units occur in headers of tables, e.g.
`deg/s^2` or `N m/(rad s)`.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Collection, Hashable, Mapping
from typing import Any, NamedTuple, NoReturn

from vsacli.base.did_you_mean import did_you_mean, nearest
from vsacli.base.errors import InputError
from vsacli.base.texts import joined

NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
"""Regular expression of a decimal number without sign."""

MAX_NESTING = 200
"""Maximum depth of parentheses, signs and powers; a level needs two Python calls, which are limited to
1000."""

_TOKEN = re.compile(
    rf"(?P<space>[ \t]+)|(?P<number>{NUMBER})|(?P<name>[^\W\d]\w*)|(?P<symbol>\*\*|[-+*/^()])", re.ASCII
)
_UNIT_TOKEN = re.compile(r"(?P<space>\s+)|(?P<number>[0-9]+)|(?P<name>[A-Za-z]+)|(?P<symbol>[*/^()])")
_EXPONENTS = ("1", "2", "3", "4")
_POWER = 3
_BINDING = {"+": 1, "-": 1, "*": 2, "/": 2, "^": _POWER, "**": _POWER}
"""Precedence of operators; powers associate to the right."""

_OPERATORS: dict[str, Callable[..., Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "^": operator.pow,
    "**": operator.pow,
    "negative": operator.neg,
}


class ExpressionError(ValueError):
    """A text that is not a valid expression.

    Attributes:
        reason: problem in words.
        place: position of the character, from 1; 0 for the whole text.
        advice: clause with advice, beginning with `;`, or empty.
    """

    def __init__(self, reason: str, place: int = 0, advice: str = "") -> None:
        self.reason, self.place, self.advice = reason, place, advice
        where = f" at character {place}" if place else ""
        super().__init__(f"{reason}{where}{advice}")


class Grammar(NamedTuple):
    """The vocabulary of an expression in addition to numbers, + - * / and parentheses.

    Attributes:
        names: words that stand for a value.
        functions: words followed by one argument in parentheses.
        powers: whether `^`, also written `**`, is allowed.
        max_length: maximum length of the text.
        of_units: whether words are units: a blank multiplies, numbers are exponents from 1 to 4, with or
            without `^`, and a product after a division is ambiguous.
    """

    names: Collection[str]
    functions: Collection[str]
    powers: bool
    max_length: int
    of_units: bool = False


class ExpressionStep(NamedTuple):
    """An operation.

    Attributes:
        operation: operator, `negative`, function, `name` or `number`.
        operands: indices of the steps that give the operands; the word or the number itself for `name` and
            `number`.
    """

    operation: str
    operands: tuple[Any, ...]


class Expression(NamedTuple):
    """An expression as steps in order of evaluation; the last one gives the value.

    Equal parts of the text share one step.
    """

    steps: tuple[ExpressionStep, ...]

    @property
    def names(self) -> set[str]:
        """Words that stand for a value."""
        return {step.operands[0] for step in self.steps if step.operation == "name"}

    def value(
        self,
        names: Mapping[str, Any],
        functions: Mapping[str, Callable[[Any], Any]],
        number: Callable[[float], Any] = float,
    ) -> Any:
        """Return the value, of any type that has the operators.

        Args:
            names: values of the names.
            functions: functions by name.
            number: conversion of numbers in the text to the type of the values.
        """
        results: list[Any] = []
        for operation, operands in self.steps:
            if operation == "number":
                results.append(number(operands[0]))
            elif operation == "name":
                results.append(names[operands[0]])
            else:
                function = _OPERATORS.get(operation) or functions[operation]
                results.append(function(*(results[operand] for operand in operands)))
        return results[-1]


def parse(text: str, grammar: Grammar) -> Expression:
    """Return the steps of an expression.

    Raises:
        ExpressionError: the text is not an expression; with reason and place.
    """
    if len(text) > grammar.max_length:
        raise ExpressionError(f"longer than {grammar.max_length} characters")
    return _Parser(_tokens(text, _UNIT_TOKEN if grammar.of_units else _TOKEN), grammar).parse()


class _Token(NamedTuple):
    kind: str
    text: str
    place: int


def _tokens(text: str, token: re.Pattern[str]) -> list[_Token]:
    tokens, position = [], 0
    while position < len(text):
        match = token.match(text, position)
        if not match:
            raise ExpressionError(f"unexpected character {text[position]!r}", position + 1)
        if match["number"] and re.match(r"0\d", match["number"]):
            reason = "a leading zero, which would mean an octal number elsewhere"
            raise ExpressionError(reason, position + 1)
        if match.lastgroup and not match["space"]:
            tokens.append(_Token(match.lastgroup, match[0], position + 1))
        position = match.end()
    return [*tokens, _Token("end", "", len(text) + 1)]


class _Parser:
    """A parser by operator precedence (V. R. Pratt, Top down operator precedence, 1973)."""

    def __init__(self, tokens: list[_Token], grammar: Grammar) -> None:
        self._tokens = iter(tokens)
        self._next = next(self._tokens)
        self._grammar = grammar
        self._nesting = 0
        self._steps: dict[Hashable, int] = {}

    def parse(self) -> Expression:
        """Return the expression of all tokens."""
        self._expression(binding=1)
        if self._next.kind != "end":
            self._refuse("an operator")
        return Expression(tuple(self._steps))  # type: ignore[arg-type]

    def _expression(self, binding: int) -> int:
        """Return the step of operands joined by operators of at least this precedence."""
        self._nesting += 1
        if self._nesting > MAX_NESTING:
            raise ExpressionError(f"nested deeper than {MAX_NESTING} levels", self._next.place)
        left_step, has_division = self._operand(), False
        while (tightness := _BINDING.get(symbol := self._operator(), 0)) >= binding:
            ambiguous = self._grammar.of_units and has_division and symbol != "/"
            if ambiguous or (tightness == _POWER and not self._grammar.powers):
                self._refuse("another operator")
            if symbol == self._next.text:
                self._take()
            has_division |= symbol == "/"
            left_step = self._step(symbol, left_step, self._expression(tightness + (tightness != _POWER)))
        self._nesting -= 1
        return left_step

    def _operator(self) -> str:
        """Return the next operator; between units it may be omitted."""
        juxtaposed = self._grammar.of_units and (self._next.kind == "name" or self._next.text == "(")
        return "*" if juxtaposed else self._next.text

    def _operand(self) -> int:
        """Return the step of a number, name, function call or parenthesis, with its signs."""
        negative = signed = False
        while self._next.text in ("+", "-"):
            negative, signed = negative ^ (self._take().text == "-"), True
        if signed:
            inner = self._expression(_POWER)
            return self._step("negative", inner) if negative else inner
        if self._grammar.of_units:
            return self._unit()
        if self._next.kind == "number":
            return self._step("number", float(self._take().text))
        if self._next.kind == "name":
            return self._word()
        return self._parentheses("a number, a word or (")

    def _unit(self) -> int:
        """Return the step of a unit or a parenthesis, with an exponent if one follows."""
        unit = self._word() if self._next.kind == "name" else self._parentheses("a unit or (")
        if self._next.text == "^":
            self._take()
        elif self._next.kind != "number":
            return unit
        if self._next.text not in _EXPONENTS:
            self._refuse("an exponent from 1 to 4")
        return self._step("^", unit, self._step("number", float(self._take().text)))

    def _word(self) -> int:
        _, word, position = self._take()
        if word in self._grammar.functions:
            return self._step(word, self._parentheses(f"( behind {word!r}"))
        if word not in self._grammar.names:
            valid_words = (*self._grammar.names, *self._grammar.functions)
            raise ExpressionError(f"unknown word {word!r}", position, did_you_mean(word, valid_words))
        return self._step("name", word)

    def _parentheses(self, otherwise: str) -> int:
        if self._next.text != "(":
            self._refuse(otherwise)
        self._take()
        inner = self._expression(binding=1)
        if self._next.text != ")":
            self._refuse("an operator or )")
        self._take()
        return inner

    def _step(self, operation: str, *operands: Any) -> int:
        """Return the index of a step; equal steps are stored once."""
        return self._steps.setdefault(ExpressionStep(operation, operands), len(self._steps))

    def _take(self) -> _Token:
        token, self._next = self._next, next(self._tokens, self._next)
        return token

    def _refuse(self, expected: str) -> NoReturn:
        _, text, position = self._next
        raise ExpressionError(f"expected {expected}, found {repr(text) if text else 'the end'}", position)


BASES: dict[str, tuple[float, dict[str, int]]] = {
    "rad": (1.0, {"rad": 1}),
    "deg": (math.pi / 180, {"rad": 1}),
    "rev": (2 * math.pi, {"rad": 1}),
    "rpm": (2 * math.pi / 60, {"rad": 1, "s": -1}),
    "m": (1.0, {"m": 1}),
    "cm": (1e-2, {"m": 1}),
    "mm": (1e-3, {"m": 1}),
    "um": (1e-6, {"m": 1}),
    "s": (1.0, {"s": 1}),
    "ms": (1e-3, {"s": 1}),
    "us": (1e-6, {"s": 1}),
    "ns": (1e-9, {"s": 1}),
    "min": (60.0, {"s": 1}),
    "Hz": (1.0, {"s": -1}),
    "kHz": (1e3, {"s": -1}),
    "N": (1.0, {"N": 1}),
    "mN": (1e-3, {"N": 1}),
    "kN": (1e3, {"N": 1}),
    "Nm": (1.0, {"N": 1, "m": 1}),
    "mNm": (1e-3, {"N": 1, "m": 1}),
    "Nmm": (1e-3, {"N": 1, "m": 1}),
    "J": (1.0, {"N": 1, "m": 1}),
    "W": (1.0, {"N": 1, "m": 1, "s": -1}),
    "kg": (1.0, {"N": 1, "m": -1, "s": 2}),
    "g": (1e-3, {"N": 1, "m": -1, "s": 2}),
    "A": (1.0, {"A": 1}),
    "mA": (1e-3, {"A": 1}),
    "V": (1.0, {"V": 1}),
    "mV": (1e-3, {"V": 1}),
    "ohm": (1.0, {"V": 1, "A": -1}),
    "mohm": (1e-3, {"V": 1, "A": -1}),
}
"""Size in SI units and dimensions of each symbol; an angle counts as a dimension, so that N m is not N
m/rad."""

_QUANTITIES = {
    "rad": "an angle",
    "rad/s": "an angular velocity",
    "rad/s^2": "an angular acceleration",
    "m": "a length",
    "m/s": "a velocity",
    "m/s^2": "an acceleration",
    "s": "a time",
    "Hz": "a frequency",
    "N": "a force",
    "N m": "a torque",
    "N m/rad": "a rotational stiffness",
    "N/m": "a linear stiffness",
    "kg": "a mass",
    "kg m^2": "a moment of inertia",
    "W": "a power",
    "A": "a current",
    "V": "a voltage",
    "ohm": "a resistance",
    "N m/A": "a torque constant",
}
"""Kinds of quantities by their SI unit, for messages."""

_SPELLINGS = str.maketrans(
    {
        "·": "*",
        ".": "*",
        "°": "deg",
        "²": "^2",
        "³": "^3",
        "⁴": "^4",
        "μ": "u",
        "µ": "u",
        "Ω": "ohm",
        "\u2126": "ohm",
    }
)
_UNITS = Grammar(BASES, (), powers=False, max_length=40, of_units=True)


class Unit:
    """A unit: its size in SI units, and its dimensions without zero exponents."""

    def __init__(self, size: float, dimensions: Mapping[str, int]) -> None:
        self.size = size
        self.dimensions = {name: exponent for name, exponent in dimensions.items() if exponent}

    def __mul__(self, other: Unit) -> Unit:
        return self._multiply_by_power(other, 1)

    def __truediv__(self, other: Unit) -> Unit:
        return self._multiply_by_power(other, -1)

    def __pow__(self, exponent: int) -> Unit:
        return Unit(1.0, {})._multiply_by_power(self, exponent)

    def _multiply_by_power(self, other: Unit, exponent: int) -> Unit:
        names = {**self.dimensions, **other.dimensions}
        dimensions = {
            name: self.dimensions.get(name, 0) + exponent * other.dimensions.get(name, 0) for name in names
        }
        return Unit(self.size * other.size**exponent, dimensions)


def conversion_factor(text: str, expected: str) -> float:
    """Return the factor that converts a number from one unit to another.

    Args:
        text: given unit: symbols of `BASES` with `^`, `*`, `/` and parentheses, a blank for a product.
        expected: unit to convert to, in the same form.

    Raises:
        InputError: the unit is not understood, or has other dimensions.
    """
    expected_unit = _parse_unit(expected)
    written_unit = size_of_unit(text)
    if written_unit is None:
        suggestion = nearest(text, _units_like(expected_unit))
        advice = f"did you mean [{suggestion}]?" if suggestion else _expected_unit_clause(expected)
        raise InputError.one(f"unknown unit [{text[: _UNITS.max_length]}]; {advice}")
    if written_unit.dimensions != expected_unit.dimensions:
        raise InputError.one(_wrong_dimensions(text, expected))
    return written_unit.size / expected_unit.size


def size_of_unit(text: str) -> Unit | None:
    """Return the unit of a text; None if it is not understood."""
    try:
        return _parse_unit(text)
    except ExpressionError:
        return None


def kind_of_unit(text: str) -> str:
    """Return the kind of quantity that a unit measures, e.g. `a length`; empty if it has no common name."""
    dimensions = _parse_unit(text).dimensions
    return next(
        (kind for unit, kind in _QUANTITIES.items() if _parse_unit(unit).dimensions == dimensions), ""
    )


def _parse_unit(text: str) -> Unit:
    expression = parse(text.translate(_SPELLINGS), _UNITS)
    unit: Unit = expression.value({name: Unit(*BASES[name]) for name in expression.names}, {}, int)
    return unit


def _units_like(unit: Unit) -> list[str]:
    """Return the symbols of units of the same dimensions."""
    return [symbol for symbol, (_, dimensions) in BASES.items() if dimensions == unit.dimensions]


def _expected_unit_clause(unit: str) -> str:
    """Return a clause with the kind of quantity, and the units in which it can be given."""
    kind, units = kind_of_unit(unit), joined(dict.fromkeys((unit, *_units_like(_parse_unit(unit)))), "or")
    return f"expected {kind} in {units}" if kind else f"expected {units}"


def _wrong_dimensions(text: str, expected: str) -> str:
    """Return the problem of a unit with other dimensions than the expected one."""
    product = text.replace("/", " ")  # g/cm^2 for g cm^2
    product_unit = size_of_unit(product)
    if product_unit is not None and product_unit.dimensions == _parse_unit(expected).dimensions:
        return f"[{text}] is not {kind_of_unit(expected) or 'of this kind'}; did you mean [{product}]?"
    unit_kind = kind_of_unit(text)
    return (
        f"[{text}] is {unit_kind}, {_expected_unit_clause(expected)}"
        if unit_kind
        else f"[{text}] does not fit; {_expected_unit_clause(expected)}"
    )
