"""Numbers in documents: decimals, expressions with `pi`, and angles in degrees.

The error of a text that is no number is a complete message: the number expected, the text found, and advice.
"""

from __future__ import annotations

import math
import re

from vsacli.base.units import ANY_SI_UNIT, DIMENSIONLESS, RATE
from vsacli.documents.expression import NUMBER, ExpressionError, Grammar, kind_of_unit, parse, size_of_unit
from vsacli.documents.tree import quoted

MAX_LENGTH = 200
ANGLES = ("rad", "rad/s", str(ANY_SI_UNIT))
"""Units in which numbers such as `90 deg` are allowed."""

BOOLEANS = frozenset({"y", "n", "yes", "no", "on", "off", "true", "false"})
"""Words that are booleans in YAML 1.1, in lower case."""

_GRAMMAR = Grammar(names=("pi",), functions=(), powers=False, max_length=MAX_LENGTH)
DECIMAL = re.compile(rf"[+-]?(?!0\d){NUMBER}", re.ASCII)
"""Regular expression of a number that `float` reads."""

PER_CENT = re.compile(r"(?P<number>.*\S)\s*%")
"""Regular expression of a share in percent."""

_DEGREES = re.compile(rf"(?P<sign>[+-]?)\s*(?P<value>{NUMBER}|\(.*\))\s*deg", re.ASCII)
_WITH_UNIT = re.compile(rf"(?P<number>[+-]?(?!0\d){NUMBER})\s*(?P<unit>[^\W\d_].*)", re.ASCII)
_WORD = re.compile(r"[^\W\d]\w*")
_OF_COMPONENTS = re.compile(r"([^,()]+) \(\w+\)")  # as in `N (forces), N m (moments)`
GRAVITY = 9.80665  # standard gravity, m/s^2, for the weight of a mass that is given as a force

_REFUSED_FORMS = {
    r"[+-]?\.?(nan|inf|infinity)": "only finite numbers can be used",
    r"[+-]?\d+(:\d+)+(\.\d*)?": "base 60 is not read; write the number in decimal",
    r"[+-]?0[xob]\w*": "write the number in decimal",
    r"[+-]?\d+(_\d+)+(\.\d*)?": "write the number without underscores",
    r"[+-]?\d+,\d+": "write a decimal point, not a comma",
    r"(.*[^\d.])?0\d.*": "write the number without a leading zero, which would make it octal elsewhere",
    r".*(°|\d *degrees?)": "degrees are written as in `90 deg`",
    r".*[-+*/]\s*": "it ends after an operator; write e.g. pi/2",
}
"""Advice on number formats that are not expressions."""


def evaluate(text: str, unit: str) -> float:
    """Return the value of a text.

    Args:
        text: number or expression, e.g. `1e-5`, `-(pi/2 + 0.1)`, `90 deg`.
        unit: unit of the value; degrees, converted to radians, are allowed for ANGLES only.

    Raises:
        ExpressionError: the text is not an expression, or its value is not finite.
    """
    try:
        value = _evaluate_text(text.strip(), unit)
    except ExpressionError as error:
        raise ExpressionError(_describe_invalid_number(text, unit, error)) from None
    if not math.isfinite(value):
        raise ExpressionError(
            f"expected {expected_number(unit)}, found {quoted(text)}; this is too large for a "
            "floating-point number"
        )
    return value


def expected_number(unit: str) -> str:
    """Return `a number in kg`, or `a number` if it has no unit, for messages."""
    return "a number" if unit in ("", str(DIMENSIONLESS)) else f"a number in {unit}"


def _evaluate_text(text: str, unit: str) -> float:
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"longer than {MAX_LENGTH} characters")
    if text.lower() in BOOLEANS:
        raise ExpressionError("YAML reads this word as a boolean")
    return _evaluate_degrees(text) if unit in ANGLES and text.endswith("deg") else _evaluate_expression(text)


def _evaluate_degrees(text: str) -> float:
    parts = _DEGREES.fullmatch(text)
    if not parts:
        raise ExpressionError(
            "before `deg`, write one number, or an expression in parentheses as in `(90/2) deg`"
        )
    inner = parts["value"].removeprefix("(").removesuffix(")")
    return math.radians(float(parts["sign"] + "1") * _evaluate_expression(inner))


def _evaluate_expression(text: str) -> float:
    try:
        return float(parse(text, _GRAMMAR).value({"pi": math.pi}, {}))
    except ZeroDivisionError:
        raise ExpressionError("division by zero") from None


def _describe_invalid_number(text: str, unit: str, error: ExpressionError) -> str:
    """Return the message about a text that is no number."""
    if unit_problem := _describe_written_unit(text.strip(), unit):
        return f"{quoted(text)} {unit_problem}"
    expected = f"expected {expected_number(unit)}, found {quoted(text)}"
    for pattern, advice in _REFUSED_FORMS.items():
        if re.fullmatch(pattern, text.strip(), re.IGNORECASE):
            return f"{expected}; {advice}"
    if not error.place:
        return f"{expected}; {error.reason}"
    if _WORD.fullmatch(text.strip()):
        return expected
    return (
        f"{expected}; an expression may have + - * /, parentheses and pi (error at character {error.place})"
    )


def _describe_written_unit(text: str, unit: str) -> str:
    """Return the problem of a number with a known unit after it; empty if the text is no such number."""
    parts = _WITH_UNIT.fullmatch(text)
    written_unit = None if parts is None else size_of_unit(parts["unit"])
    if parts is None or written_unit is None or (unit in ANGLES and text.endswith("deg")):
        return ""
    if unit in ("", str(DIMENSIONLESS)):
        return "has a unit; write the number alone"
    expected_unit = size_of_unit("Hz" if unit == str(RATE) else unit)
    several = map(size_of_unit, _OF_COMPONENTS.findall(unit)) if expected_unit is None else [expected_unit]
    dimensions = [each.dimensions for each in several if each is not None]  # none of "SI units"
    if dimensions and written_unit.dimensions not in dimensions:
        kind, mass = kind_of_unit(parts["unit"]), abs(float(parts["number"])) * written_unit.size
        hint = (
            f"; {mass:g} kg weigh {GRAVITY * mass:.3g} N"
            if (kind, unit.partition(" (")[0]) == ("a mass", "N")
            else ""
        )
        return f"is {kind or 'in another unit'}; expected {expected_number(unit)}{hint}"
    if expected_unit is None:
        return f"has a unit; write the number alone, in {unit}"
    converted = float(parts["number"]) * written_unit.size / expected_unit.size
    return f"has a unit; write the number alone, in {unit}: {converted:.10g}"
