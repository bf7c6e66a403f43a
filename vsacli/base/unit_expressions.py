"""Units as they are written in the headers of tables, e.g. `deg/s^2` or `N m/(rad s)`, and their size."""

from __future__ import annotations

import math
import re
from collections import Counter
from typing import NamedTuple

from vsacli.base.errors import InputError

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
"""Size in SI and dimensions of each symbol; an angle counts as a dimension, so that N m is not N m/rad."""

MAX_LENGTH = 40
"""Characters of a unit; a longer one is none."""

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
_TOKENS = re.compile(r"[A-Za-z]+|[0-9]+|[*/^()]")


class Unit(NamedTuple):
    """A unit: its size in SI, and its dimensions without zero exponents."""

    size: float
    dimensions: dict[str, int]


def conversion_factor(text: str, expected: str) -> float:
    """What a number in a unit is to be multiplied by to be one in another unit.

    Args:
        text: the unit found: symbols of `BASES` with `^`, `*`, `/` and parentheses, a blank for a product.
        expected: the unit wanted, likewise.

    Raises:
        InputError: the unit is not understood, or is one of something else.
    """
    wanted = _parsed(expected)
    try:
        found = _parsed(text)
    except ValueError:
        understood = f"{', '.join(BASES)} with * / ^ and parentheses"
        message = (
            f"the unit [{text[:MAX_LENGTH]}] is not understood; expected {expected} or the like, made of"
        )
        raise InputError.one(f"{message} {understood}") from None
    if found.dimensions != wanted.dimensions:
        raise InputError.one(f"the unit [{text}] is one of something else; expected {expected} or the like")
    return found.size / wanted.size


def _parsed(text: str) -> Unit:
    """The unit that a text stands for.

    Raises:
        ValueError: it stands for none.
    """
    spelled = text.translate(_SPELLINGS)
    if len(spelled) > MAX_LENGTH:
        raise ValueError(spelled)
    tokens = _TOKENS.findall(spelled)
    if "".join(tokens) != "".join(spelled.split()):
        raise ValueError(text)
    unit = _quotient(tokens)
    if tokens:
        raise ValueError(text)
    return unit


def _quotient(tokens: list[str]) -> Unit:
    """A product, then divisors one by one; a product of divisors must be in parentheses."""
    unit = _factor(tokens)
    divided = False
    while tokens and tokens[0] != ")":
        divides = tokens[0] == "/"
        if divided and not divides:
            raise ValueError("ambiguous")
        if tokens[0] in "*/":
            tokens.pop(0)
        unit = _product(unit, _factor(tokens), -1 if divides else 1)
        divided |= divides
    return unit


def _factor(tokens: list[str]) -> Unit:
    token = tokens.pop(0) if tokens else ""
    if token == "(":
        unit = _quotient(tokens)
        if not tokens or tokens.pop(0) != ")":
            raise ValueError("no closing parenthesis")
    elif token in BASES:
        unit = Unit(*BASES[token])
    else:
        raise ValueError(token)
    if tokens and tokens[0] == "^":
        tokens.pop(0)
    elif not (tokens and tokens[0].isdigit()):
        return unit
    power = tokens.pop(0) if tokens else ""
    if power not in ("1", "2", "3", "4"):
        raise ValueError(power)
    return _product(Unit(1.0, {}), unit, int(power))


def _product(unit: Unit, other: Unit, power: int) -> Unit:
    dimensions = Counter(unit.dimensions)
    for dimension, exponent in other.dimensions.items():
        dimensions[dimension] += power * exponent
    return Unit(unit.size * other.size**power, {name: n for name, n in dimensions.items() if n})
