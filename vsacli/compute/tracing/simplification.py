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


def fold_operation(operation: str, operands: Sequence[Operand]) -> Operand | None:
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
    rule = _FOLDING_RULES.get(operation)
    return None if rule is None else rule(*operands)


_STRICT = frozenset({"less", "greater"})
"""Comparisons that are false for a value and itself."""


def _is_nan(operand: Operand) -> bool:
    return isinstance(operand, float) and math.isnan(operand)


def _is_constant(operand: Operand, constant: float) -> bool:
    return not isinstance(operand, Symbol) and operand == constant


def _neutral_rule(constant: float) -> Callable[[Operand, Operand], Operand | None]:
    """Return the rule that a constant is the neutral element of a commutative operation."""

    def rule(a: Operand, b: Operand) -> Operand | None:
        return b if _is_constant(a, constant) else _second_neutral_rule(constant)(a, b)

    return rule


def _second_neutral_rule(constant: float) -> Callable[[Operand, Operand], Operand | None]:
    """Return the rule that a constant second operand leaves the first operand unchanged."""
    return lambda a, b: a if _is_constant(b, constant) else None


def _fold_negative(a: Operand) -> Operand | None:
    return a.operands[0] if isinstance(a, Symbol) and a.operation == "negative" else None


def _fold_and(a: Operand, b: Operand) -> Operand | None:
    if a is False or b is False:
        return False
    if a is True:
        return b
    return a if b is True or a is b else None


def _fold_or(a: Operand, b: Operand) -> Operand | None:
    if a is True or b is True:
        return True
    if a is False:
        return b
    return a if b is False or a is b else None


def _fold_not(a: Operand) -> Operand | None:
    return a.operands[0] if isinstance(a, Symbol) and a.operation == "logical_not" else None


def _fold_where(condition: Operand, a: Operand, b: Operand) -> Operand | None:
    if condition is True or a is b or (_is_nan(a) and _is_nan(b)):
        return a
    return b if condition is False else None


def _fold_bitwise_and(a: Operand, b: Operand) -> Operand | None:
    return 0 if _is_constant(a, 0) or _is_constant(b, 0) else None


_FOLDING_RULES: dict[str, Callable[..., Operand | None]] = {
    "add": _neutral_rule(0),
    "subtract": _second_neutral_rule(0),
    "multiply": _neutral_rule(1),
    "divide": _second_neutral_rule(1),
    "negative": _fold_negative,
    "logical_and": _fold_and,
    "logical_or": _fold_or,
    "logical_not": _fold_not,
    "where": _fold_where,
    "bitwise_or": _neutral_rule(0),
    "bitwise_and": _fold_bitwise_and,
}


LiveBodies = dict[tuple[int, frozenset[int]], Program]
"""Bodies of calls without dead code, by identity of the program and indices of the outputs that are read."""


def without_dead_code(
    inputs: Sequence[Symbol], operations: Sequence[Symbol], outputs: Sequence[Operand]
) -> Program:
    """Return the program with only those operations that the outputs require."""
    needed = {output.index for output in outputs if isinstance(output, Symbol)}
    read_outputs: dict[int, set[int]] = defaultdict(set)
    live_bodies: LiveBodies = {}
    live_operations = []
    for symbol in reversed(operations):
        if symbol.index not in needed:
            continue
        if symbol.operation == "item":
            container, output_index = symbol.operands
            read_outputs[container.index].add(output_index)
        elif symbol.operation == "loop":
            symbol = _live_loop(symbol, read_outputs[symbol.index])
        elif symbol.operation == "branch":
            symbol = _live_branch(symbol, read_outputs[symbol.index])
        elif symbol.operation == "call":
            symbol = _live_call(symbol, read_outputs[symbol.index], live_bodies)
        needed.update(operand.index for operand in symbol.operands if isinstance(operand, Symbol))
        live_operations.append(symbol)
    return Program(tuple(inputs), tuple(reversed(live_operations)), tuple(outputs))


def _live_loop(symbol: Symbol, read_outputs: set[int]) -> Symbol:
    """Return a loop reduced to the state on which the wanted entries and the end depend."""
    (body, limit, indices), *operands = symbol.operands
    state_indices = _remaining_indices(indices, read_outputs)
    live_indices: set[int] = set()
    while state_indices - live_indices:
        live_indices |= state_indices
        live_body = without_dead_code(
            body.inputs, body.operations, [*_select_entries(body.outputs, live_indices), body.outputs[-1]]
        )
        state_indices = {
            index for index in range(len(indices)) if body.inputs[index].index in _used_indices(live_body)
        }
    used_values = _used_indices(live_body)
    inputs, live_operands = [], []
    for index, (inner, operand) in enumerate(zip(body.inputs, operands, strict=True)):
        if index in live_indices or (index >= len(indices) and inner.index in used_values):
            inputs.append(inner)
            live_operands.append(operand)
    loop = Loop(
        live_body._replace(inputs=tuple(inputs)), limit, tuple(_select_entries(indices, live_indices))
    )
    return symbol.with_operands([loop, *live_operands])


def _live_branch(symbol: Symbol, read_outputs: set[int]) -> Symbol:
    """Return a branch reduced to the wanted outputs."""
    (body, indices), condition, *operands = symbol.operands
    output_indices = _remaining_indices(indices, read_outputs)
    live_body = without_dead_code(body.inputs, body.operations, _select_entries(body.outputs, output_indices))
    used_values = _used_indices(live_body)
    arguments = [
        (inner, operand)
        for inner, operand in zip(body.inputs, operands[len(indices) :], strict=True)
        if inner.index in used_values
    ]
    branch = Branch(
        live_body._replace(inputs=tuple(inner for inner, _ in arguments)),
        tuple(_select_entries(indices, output_indices)),
    )
    live_operands = [operand for _, operand in arguments]
    return symbol.with_operands(
        [branch, condition, *_select_entries(operands, output_indices), *live_operands]
    )


def _live_call(symbol: Symbol, read_outputs: set[int], live_bodies: LiveBodies) -> Symbol:
    """Return a call reduced to the wanted outputs; calls that want the same outputs still share a program."""
    (body, indices), *operands = symbol.operands
    output_indices = frozenset(_remaining_indices(indices, read_outputs))
    key = id(body), output_indices
    if key not in live_bodies:
        live_body = without_dead_code(
            body.inputs, body.operations, _select_entries(body.outputs, output_indices)
        )
        used_values = _used_indices(live_body)
        inputs = tuple(inner for inner in body.inputs if inner.index in used_values)
        live_bodies[key] = live_body._replace(inputs=inputs)
    live_body = live_bodies[key]
    live_inputs = {inner.index for inner in live_body.inputs}
    live_operands = [
        operand for inner, operand in zip(body.inputs, operands, strict=True) if inner.index in live_inputs
    ]
    return symbol.with_operands(
        [Call(live_body, tuple(_select_entries(indices, output_indices))), *live_operands]
    )


def _remaining_indices(indices: Sequence[int], read_outputs: Iterable[int]) -> set[int]:
    """Return the places of results among those left by an earlier elimination."""
    return {indices.index(index) for index in read_outputs}


def _select_entries(entries: Sequence[Any], indices: Iterable[int]) -> list[Any]:
    return [entries[index] for index in sorted(indices)]


def _used_indices(program: Program) -> set[int]:
    """Return the values that a program reads or returns."""
    operands = (operand for symbol in program.operations for operand in symbol.operands)
    return {operand.index for operand in (*operands, *program.outputs) if isinstance(operand, Symbol)}
