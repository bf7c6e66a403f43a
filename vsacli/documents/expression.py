"""Expressions in documents: numbers, words and functions, + - * / and powers, parsed into steps.

Whoever reads a document says which words there are. A text is never given to Python, and neither its length
nor its nesting can exhaust anything.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Collection, Hashable, Mapping
from typing import Any, NamedTuple, NoReturn

from vsacli.base.did_you_mean import did_you_mean

NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
"""A decimal number without sign."""

MAX_NESTING = 200
"""Parentheses, signs and powers inside each other; each takes two calls of Python, which stops at 1000."""

_TOKEN = re.compile(
    rf"(?P<space>[ \t]+)|(?P<number>{NUMBER})|(?P<name>[^\W\d]\w*)|(?P<symbol>\*\*|[-+*/^()])", re.ASCII
)
_POWER = 3
_BINDING = {"+": 1, "-": 1, "*": 2, "/": 2, "^": _POWER, "**": _POWER}
"""How tightly operators bind; powers are taken from right to left."""

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
    """A text is no expression.

    Attributes:
        reason: what is wrong.
        place: number of the character where it is, from 1; 0 if it is everywhere.
        remedy: a clause on what would do, beginning with `;`, or nothing.
    """

    def __init__(self, reason: str, place: int = 0, remedy: str = "") -> None:
        self.reason, self.place, self.remedy = reason, place, remedy
        where = f" at character {place}" if place else ""
        super().__init__(f"{reason}{where}{remedy}")


class Grammar(NamedTuple):
    """What may stand in an expression besides numbers, + - * / and parentheses.

    Attributes:
        names: words that stand for a value.
        functions: words that take one argument in parentheses.
        powers: whether `^`, which may be written `**`, is there.
        max_length: of the text.
    """

    names: Collection[str]
    functions: Collection[str]
    powers: bool
    max_length: int


class Step(NamedTuple):
    """One operation.

    Attributes:
        operation: an operator, `negative`, a function, `name` or `number`.
        operands: numbers of the steps whose results it takes; of the last two the word, or the number.
    """

    operation: str
    operands: tuple[Any, ...]


class Expression(NamedTuple):
    """An expression as steps, each after those that it needs; the last one gives the value.

    What stands in the text several times is one step.
    """

    steps: tuple[Step, ...]

    @property
    def names(self) -> set[str]:
        """The words that stand for a value."""
        return {step.operands[0] for step in self.steps if step.operation == "name"}

    def value(
        self,
        names: Mapping[str, Any],
        functions: Mapping[str, Callable[[Any], Any]],
        number: Callable[[float], Any] = float,
    ) -> Any:
        """The value for anything that has the operators.

        Args:
            names: their values.
            functions: by their words.
            number: makes such a thing of a number that stands in the text.
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
    """The steps of an expression.

    Raises:
        ExpressionError: it is none, with the reason and the place.
    """
    if len(text) > grammar.max_length:
        raise ExpressionError(f"longer than {grammar.max_length} characters")
    return _Parser(_tokens(text), grammar).parsed()


class _Token(NamedTuple):
    kind: str
    text: str
    place: int


def _tokens(text: str) -> list[_Token]:
    tokens, position = [], 0
    while position < len(text):
        found = _TOKEN.match(text, position)
        if not found:
            raise ExpressionError(f"unexpected character {text[position]!r}", position + 1)
        if found["number"] and re.match(r"0\d", found["number"]):
            reason = "a leading zero, which would mean an octal number elsewhere"
            raise ExpressionError(reason, position + 1)
        if found.lastgroup and not found["space"]:
            tokens.append(_Token(found.lastgroup, found[0], position + 1))
        position = found.end()
    return [*tokens, _Token("end", "", len(text) + 1)]


class _Parser:
    """Operator precedence, one token after the other (V. R. Pratt, Top down operator precedence, 1973)."""

    def __init__(self, tokens: list[_Token], grammar: Grammar) -> None:
        self._tokens = iter(tokens)
        self._next = next(self._tokens)
        self._grammar = grammar
        self._nesting = 0
        self._steps: dict[Hashable, int] = {}

    def parsed(self) -> Expression:
        """All of it."""
        self._expression(binding=1)
        if self._next.kind != "end":
            self._refuse("an operator")
        return Expression(tuple(self._steps))  # type: ignore[arg-type]

    def _expression(self, binding: int) -> int:
        """The step of what operators join that bind at least as tightly."""
        self._nesting += 1
        if self._nesting > MAX_NESTING:
            raise ExpressionError(f"nested deeper than {MAX_NESTING} levels", self._next.place)
        left = self._operand()
        while (tightness := _BINDING.get(self._next.text, 0)) >= binding:
            if tightness == _POWER and not self._grammar.powers:
                self._refuse("another operator")
            symbol = self._take().text
            left = self._step(symbol, left, self._expression(tightness + (tightness != _POWER)))
        self._nesting -= 1
        return left

    def _operand(self) -> int:
        """The step of a number, a name, a function, what is in parentheses, or one of these with signs."""
        negative = signed = False
        while self._next.text in ("+", "-"):
            negative, signed = negative ^ (self._take().text == "-"), True
        if signed:
            inner = self._expression(_POWER)
            return self._step("negative", inner) if negative else inner
        if self._next.kind == "number":
            return self._step("number", float(self._take().text))
        if self._next.kind == "name":
            return self._word()
        return self._parentheses("a number, a word or (")

    def _word(self) -> int:
        _, word, place = self._take()
        if word in self._grammar.functions:
            return self._step(word, self._parentheses(f"( behind {word!r}"))
        if word not in self._grammar.names:
            known = (*self._grammar.names, *self._grammar.functions)
            raise ExpressionError(f"unknown word {word!r}", place, did_you_mean(word, known))
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
        """The number of a step, which is there once."""
        return self._steps.setdefault(Step(operation, operands), len(self._steps))

    def _take(self) -> _Token:
        token, self._next = self._next, next(self._tokens, self._next)
        return token

    def _refuse(self, expected: str) -> NoReturn:
        _, text, place = self._next
        raise ExpressionError(f"expected {expected}, found {repr(text) if text else 'the end'}", place)
