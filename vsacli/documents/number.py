"""Numbers in documents: decimal numbers, short expressions of them with `pi`, and angles in degrees."""

from __future__ import annotations

import math
import re

from vsacli.base.units import ANY_SI_UNIT
from vsacli.documents.expression import NUMBER, ExpressionError, Grammar, parse

MAX_LENGTH = 200
ANGLES = ("rad", "rad/s", str(ANY_SI_UNIT))
"""Units in which `90 deg` may be written."""

BOOLEANS = frozenset({"y", "n", "yes", "no", "on", "off", "true", "false"})
"""Words that YAML 1.1 takes for booleans, in lower case."""

_GRAMMAR = Grammar(names=("pi",), functions=(), powers=False, max_length=MAX_LENGTH)
_DECIMAL = re.compile(rf"[+-]?(?!0\d){NUMBER}", re.ASCII)
_DEGREES = re.compile(rf"(?P<sign>[+-]?)\s*(?P<value>{NUMBER}|\(.*\))\s*deg", re.ASCII)

_REFUSED_FORMS = {
    r"[+-]?\.?(nan|inf|infinity)": "only finite numbers can be used",
    r"[+-]?\d+(:\d+)+(\.\d*)?": "base 60 is not read; write the number in decimal",
    r"[+-]?0[xob]\w*": "write the number in decimal",
    r"[+-]?\d+(_\d+)+(\.\d*)?": "write the number without underscores",
    r"[+-]?\d+,\d+": "write a decimal point, not a comma",
    r".*°": "unexpected character '°'; degrees are written as in `90 deg`",
}
"""What to advise for forms that are no expressions."""


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
    try:
        return float(parse(text, _GRAMMAR).value({"pi": math.pi}, {}))
    except ExpressionError as error:
        remedy = "; write a number, or an expression with + - * /, parentheses and pi"
        raise ExpressionError(error.reason, remedy=remedy) from None
    except ZeroDivisionError:
        raise ExpressionError("division by zero") from None
