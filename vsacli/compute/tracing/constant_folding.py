"""Constant folding: operations that a constant among their operands decides are not carried out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from vsacli.compute.tracing.program import COMPARISONS, NAN_PROPAGATING, Operand, Symbol


def folded(operation: str, operands: Sequence[Operand]) -> Operand | None:
    """The result if it is a constant or one of the operands; None if the operation has to be carried out.

    What NumPy would compute is kept, NaN and infinity included: 0 x is not 0. But x + 0 is x, also where x
    is -0.
    """
    if operation in NAN_PROPAGATING and any(map(_is_nan, operands)):
        return math.nan
    if operation in COMPARISONS and any(map(_is_nan, operands)):
        return operation == "not_equal"
    if operation in _STRICT and operands[0] is operands[1]:
        return False
    rule = _RULES.get(operation)
    return None if rule is None else rule(*operands)


_STRICT = frozenset({"less", "greater"})
"""Comparisons that hold between no value and itself."""


def _is_nan(operand: Operand) -> bool:
    return isinstance(operand, float) and math.isnan(operand)


def _is(operand: Operand, constant: float) -> bool:
    return not isinstance(operand, Symbol) and operand == constant


def _neutral(constant: float) -> Callable[[Operand, Operand], Operand | None]:
    """The rule of a commutative operation that a constant leaves the other operand as it is."""

    def rule(a: Operand, b: Operand) -> Operand | None:
        return b if _is(a, constant) else _second_neutral(constant)(a, b)

    return rule


def _second_neutral(constant: float) -> Callable[[Operand, Operand], Operand | None]:
    """The rule of an operation that a constant leaves the first operand as it is."""
    return lambda a, b: a if _is(b, constant) else None


def _negative(a: Operand) -> Operand | None:
    return a.operands[0] if isinstance(a, Symbol) and a.operation == "negative" else None


def _and(a: Operand, b: Operand) -> Operand | None:
    if a is False or b is False:
        return False
    if a is True:
        return b
    return a if b is True or a is b else None


def _or(a: Operand, b: Operand) -> Operand | None:
    if a is True or b is True:
        return True
    if a is False:
        return b
    return a if b is False or a is b else None


def _not(a: Operand) -> Operand | None:
    return a.operands[0] if isinstance(a, Symbol) and a.operation == "logical_not" else None


def _where(truth: Operand, a: Operand, b: Operand) -> Operand | None:
    if truth is True or a is b or (_is_nan(a) and _is_nan(b)):
        return a
    return b if truth is False else None


def _bitwise_and(a: Operand, b: Operand) -> Operand | None:
    return 0 if _is(a, 0) or _is(b, 0) else None


_RULES: dict[str, Callable[..., Operand | None]] = {
    "add": _neutral(0),
    "subtract": _second_neutral(0),
    "multiply": _neutral(1),
    "divide": _second_neutral(1),
    "negative": _negative,
    "logical_and": _and,
    "logical_or": _or,
    "logical_not": _not,
    "where": _where,
    "bitwise_or": _neutral(0),
    "bitwise_and": _bitwise_and,
}
