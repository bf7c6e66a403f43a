"""Simplification of programs: constant folding while they are traced, dead code elimination at the end."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from vsacli.compute.tracing.program import (
    COMPARISONS,
    NAN_PROPAGATING,
    Branch,
    Call,
    Loop,
    Operand,
    Program,
    Symbol,
)


def folded(operation: str, operands: Sequence[Operand]) -> Operand | None:
    """Return the result if it is a constant or an operand; None if the operation must be computed.

    Results are those of NumPy, including NaN and infinity: 0 x is not folded to 0. One exception: x + 0 is x,
    also if x is -0.
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
"""Comparisons that are false for a value and itself."""


def _is_nan(operand: Operand) -> bool:
    return isinstance(operand, float) and math.isnan(operand)


def _is(operand: Operand, constant: float) -> bool:
    return not isinstance(operand, Symbol) and operand == constant


def _neutral(constant: float) -> Callable[[Operand, Operand], Operand | None]:
    """Return the rule that a constant is the neutral element of a commutative operation."""

    def rule(a: Operand, b: Operand) -> Operand | None:
        return b if _is(a, constant) else _second_neutral(constant)(a, b)

    return rule


def _second_neutral(constant: float) -> Callable[[Operand, Operand], Operand | None]:
    """Return the rule that a constant second operand leaves the first operand unchanged."""
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


Shortened = dict[tuple[int, frozenset[int]], Program]
"""Shortened programs of calls, by identity of the program and indices of the outputs that are read."""


def without_dead_code(
    inputs: Sequence[Symbol], operations: Sequence[Symbol], outputs: Sequence[Operand]
) -> Program:
    """Return the program with only those operations that the outputs require."""
    needed = {output.index for output in outputs if isinstance(output, Symbol)}
    items: dict[int, set[int]] = defaultdict(set)
    shortened: Shortened = {}
    kept = []
    for symbol in reversed(operations):
        if symbol.index not in needed:
            continue
        if symbol.operation == "item":
            nested, number = symbol.operands
            items[nested.index].add(number)
        elif symbol.operation == "loop":
            symbol = _loop(symbol, items[symbol.index])
        elif symbol.operation == "branch":
            symbol = _branch(symbol, items[symbol.index])
        elif symbol.operation == "call":
            symbol = _call(symbol, items[symbol.index], shortened)
        needed.update(operand.index for operand in symbol.operands if isinstance(operand, Symbol))
        kept.append(symbol)
    return Program(tuple(inputs), tuple(reversed(kept)), tuple(outputs))


def _loop(symbol: Symbol, wanted: set[int]) -> Symbol:
    """Return a loop reduced to the state on which the wanted entries and the end depend."""
    (body, limit, numbers), *operands = symbol.operands
    places = _places(numbers, wanted)
    live: set[int] = set()
    while places - live:
        live |= places
        shorter = without_dead_code(
            body.inputs, body.operations, [*_chosen(body.outputs, live), body.outputs[-1]]
        )
        places = {place for place in range(len(numbers)) if body.inputs[place].index in _used(shorter)}
    used = _used(shorter)
    inputs, given = [], []
    for place, (inner, operand) in enumerate(zip(body.inputs, operands, strict=True)):
        if place in live or (place >= len(numbers) and inner.index in used):
            inputs.append(inner)
            given.append(operand)
    loop = Loop(shorter._replace(inputs=tuple(inputs)), limit, tuple(_chosen(numbers, live)))
    return symbol.with_operands([loop, *given])


def _branch(symbol: Symbol, wanted: set[int]) -> Symbol:
    """Return a branch reduced to the wanted outputs."""
    (body, numbers), truth, *operands = symbol.operands
    places = _places(numbers, wanted)
    shorter = without_dead_code(body.inputs, body.operations, _chosen(body.outputs, places))
    used = _used(shorter)
    arguments = [
        (inner, operand)
        for inner, operand in zip(body.inputs, operands[len(numbers) :], strict=True)
        if inner.index in used
    ]
    branch = Branch(
        shorter._replace(inputs=tuple(inner for inner, _ in arguments)), tuple(_chosen(numbers, places))
    )
    given = [operand for _, operand in arguments]
    return symbol.with_operands([branch, truth, *_chosen(operands, places), *given])


def _call(symbol: Symbol, wanted: set[int], shortened: Shortened) -> Symbol:
    """Return a call reduced to the wanted outputs; calls that want the same outputs still share a program."""
    (body, numbers), *operands = symbol.operands
    places = frozenset(_places(numbers, wanted))
    key = id(body), places
    if key not in shortened:
        shorter = without_dead_code(body.inputs, body.operations, _chosen(body.outputs, places))
        used = _used(shorter)
        inputs = tuple(inner for inner in body.inputs if inner.index in used)
        shortened[key] = shorter._replace(inputs=inputs)
    shorter = shortened[key]
    left = {inner.index for inner in shorter.inputs}
    given = [operand for inner, operand in zip(body.inputs, operands, strict=True) if inner.index in left]
    return symbol.with_operands([Call(shorter, tuple(_chosen(numbers, places))), *given])


def _places(numbers: Sequence[int], wanted: Iterable[int]) -> set[int]:
    """Return the places of results among those left by an earlier elimination."""
    return {numbers.index(number) for number in wanted}


def _chosen(entries: Sequence[Any], places: Iterable[int]) -> list[Any]:
    return [entries[place] for place in sorted(places)]


def _used(program: Program) -> set[int]:
    """Return the values that a program reads or returns."""
    operands = (operand for symbol in program.operations for operand in symbol.operands)
    return {operand.index for operand in (*operands, *program.outputs) if isinstance(operand, Symbol)}
