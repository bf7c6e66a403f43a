"""The operations that can be recorded; each is named as the function of NumPy whose meaning it has."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from vsacli.compute.tracing.symbol import Kind, Symbol

COMPARISONS = ("less", "less_equal", "greater", "greater_equal", "equal", "not_equal")
LOGICAL = {"logical_and": "and", "logical_or": "or", "logical_not": "not"}
BITWISE = {"bitwise_and": "and", "bitwise_or": "or", "invert": "not"}
COMMUTATIVE = frozenset({"add", "multiply", "logical_and", "logical_or", "bitwise_and", "bitwise_or"})

FUNCTIONS = frozenset(
    {
        *("absolute", "sqrt", "cbrt", "exp", "expm1", "log", "log1p", "power", "hypot", "copysign"),
        *("sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh", "arcsinh"),
    }
)
"""Real functions of real values."""

CHOOSING = frozenset({"maximum", "minimum"})
ARITHMETIC = frozenset({"add", "subtract", "multiply", "divide", "negative"})
LETTING_NAN_PASS = (FUNCTIONS | ARITHMETIC | CHOOSING) - {"power", "hypot", "copysign"}
"""Operations that give NaN wherever an operand is; the others do not: 1 to the power of NaN is 1."""

_KINDS = {
    **dict.fromkeys(FUNCTIONS, Kind.REAL),
    **dict.fromkeys((*COMPARISONS, *LOGICAL, "isnan"), Kind.TRUTH),
    **dict.fromkeys(("bits", "bitwise_and", "bitwise_or"), Kind.BITS),
    "searchsorted": Kind.INDEX,
    "take": Kind.REAL,
}


def kind_of(operand: Any) -> Kind:
    """The kind of a value; a plain integer is a real number wherever it may be one."""
    if isinstance(operand, Symbol):
        return operand.kind
    return Kind.TRUTH if isinstance(operand, bool) else Kind.REAL


def kind_of_result(operation: str, operands: Sequence[Any]) -> Kind:
    """The kind of an operation's result.

    Raises:
        NotImplementedError: it is none of those that can be recorded.
    """
    if operation in _KINDS:
        return _KINDS[operation]
    if operation == "where":
        return _common_kind(operands[1:])
    if operation in ARITHMETIC | CHOOSING:
        return _kind_of_number(operation, operands)
    raise NotImplementedError(f"the operation {operation} cannot be recorded")


def _kind_of_number(operation: str, operands: Sequence[Any]) -> Kind:
    kind = _common_kind(operands)
    if kind is Kind.TRUTH:
        raise NotImplementedError(
            f"{operation} of a truth value cannot be recorded; numpy.where makes a number of it"
        )
    if kind is Kind.INDEX and not all(isinstance(operand, Symbol | int) for operand in operands):
        raise NotImplementedError(f"{operation} of an index is recorded with whole numbers only")
    return kind


def _common_kind(operands: Sequence[Any]) -> Kind:
    """That of the symbols; constants adapt."""
    kinds = {operand.kind for operand in operands if isinstance(operand, Symbol)}
    kinds = kinds or set(map(kind_of, operands))
    if len(kinds) > 1:
        raise NotImplementedError(f"values of different kinds cannot be joined: {kinds}")
    return kinds.pop()
