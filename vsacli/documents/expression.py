"""Numbers in documents: decimal numbers, short expressions of them with `pi`, and angles in degrees."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable

MAX_LENGTH = 200
ANGLES = ("rad", "rad/s")
"""Units in which `90 deg` may be written."""

BOOLEANS = frozenset({"y", "n", "yes", "no", "on", "off", "true", "false"})
"""Words that YAML 1.1 takes for booleans, in lower case."""

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_DECIMAL = re.compile(rf"[+-]?(?!0\d){_NUMBER}", re.ASCII)
_TOKEN = re.compile(
    rf"(?P<space>[ \t]+)|(?P<number>{_NUMBER})|(?P<name>[^\W\d]\w*)|(?P<symbol>[-+*/()])", re.ASCII
)
_DEGREES = re.compile(rf"(?P<sign>[+-]?)\s*(?P<value>{_NUMBER}|\(.*\))\s*deg", re.ASCII)

_REFUSED_FORMS = {
    r"[+-]?\.?(nan|inf|infinity)": "only finite numbers can be used",
    r"[+-]?\d+(:\d+)+(\.\d*)?": "base 60 is not read; write the number in decimal",
    r"[+-]?0[xob]\w*": "write the number in decimal",
    r"[+-]?\d+(_\d+)+(\.\d*)?": "write the number without underscores",
    r"[+-]?\d+,\d+": "write a decimal point, not a comma",
}
"""What to advise for forms that are no expressions."""

_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_UNARY: dict[type[ast.unaryop], Callable[[float], float]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}


class ExpressionError(ValueError):
    """A text is no number; the message says why and what would be one."""


def evaluate(text: str, unit: str) -> float:
    """The number a text stands for.

    Args:
        text: e.g. `1e-5`, `-(pi/2 + 0.1)`, `90 deg`.
        unit: of the number; degrees, converted to radians, are admitted for ANGLES only.

    Raises:
        ExpressionError: anything else, or a value that is not finite.
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"longer than {MAX_LENGTH} characters")
    text = text.strip()
    if text.lower() in BOOLEANS:
        raise ExpressionError("YAML takes this word for a boolean")
    try:
        value = _degrees(text, unit) if text.endswith("deg") else _expression(text)
    except ExpressionError:
        for form, advice in _REFUSED_FORMS.items():
            if re.fullmatch(form, text, re.IGNORECASE):
                raise ExpressionError(advice) from None
        raise
    if not math.isfinite(value):
        raise ExpressionError("the value is too large for a floating-point number")
    return value


def _degrees(text: str, unit: str) -> float:
    if unit not in ANGLES:
        raise ExpressionError(f"degrees are for angles only, and the unit here is {unit}")
    parts = _DEGREES.fullmatch(text)
    if not parts:
        raise ExpressionError(
            "before `deg`, write one number, or an expression in parentheses as in `(90/2) deg`"
        )
    inner = parts["value"].removeprefix("(").removesuffix(")")
    return math.radians(float(parts["sign"] + "1") * _expression(inner))


def _expression(text: str) -> float:
    if _DECIMAL.fullmatch(text):
        return float(text)
    _check_tokens(text)
    try:
        return _value(ast.parse(text.strip(), mode="eval").body)
    except SyntaxError:
        raise ExpressionError("write a number, or an expression with + - * /, parentheses and pi") from None
    except ZeroDivisionError:
        raise ExpressionError("division by zero") from None


def _check_tokens(text: str) -> None:
    """Let pass only numbers, `pi` and operators; what follows then never sees any other Python."""
    position = 0
    while position < len(text):
        token = _TOKEN.match(text, position)
        if not token:
            hint = "; degrees are written as in `90 deg`" if text[position] == "°" else ""
            raise ExpressionError(f"unexpected character {text[position]!r}{hint}")
        if token["name"] and token["name"] != "pi":
            raise ExpressionError(f"unknown word {token['name']!r}; only `pi` may stand in an expression")
        if token["number"] and re.match(r"0\d", token["number"]):
            raise ExpressionError(
                "a leading zero would mean an octal number elsewhere; write the number without it"
            )
        position = token.end()


def _value(node: ast.expr) -> float:
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name():
            return math.pi
        case ast.UnaryOp(op=sign, operand=operand):
            return _UNARY[type(sign)](_value(operand))
        case ast.BinOp(op=sign, left=left, right=right) if type(sign) in _BINARY:
            return _BINARY[type(sign)](_value(left), _value(right))
    raise ExpressionError("only + - * / and parentheses may join numbers")
