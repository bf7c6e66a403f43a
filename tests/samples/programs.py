"""Traced programs, carried out by NumPy operation by operation: what they mean, apart from any C."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from vsacli.compute.tracing import Program, Symbol, Tape, TracedArray, cells_of

Values = list[Any]

MEANING: dict[str, Callable[..., Any]] = {
    "bits": lambda truth, mask: np.where(truth, np.uint32(mask), np.uint32(0)),
    "searchsorted": lambda table, values: np.searchsorted(table.values, values, side="right"),
    "take": lambda table, index: np.asarray(table.values)[index],
}
"""Operations that are no function of NumPy with these operands."""


def traced(function: Callable[..., Any], count: int) -> Program:
    """What a function of `count` rows of samples does."""
    tape = Tape()
    rows = [TracedArray(tape, [symbol]) for symbol in tape.inputs(count)]
    results = function(*rows)
    results = results if isinstance(results, tuple | list) else [results]
    return tape.program([cell for result in results for cell in cells_of(result).ravel()])


def carry_out(program: Program, inputs: Sequence[np.ndarray]) -> Values:
    """The outputs for rows of samples; constants among them are as they are."""
    found: dict[int, Any] = {symbol.index: row for symbol, row in zip(program.inputs, inputs, strict=True)}

    def value(operand: Any) -> Any:
        return found[operand.index] if isinstance(operand, Symbol) else operand

    with np.errstate(all="ignore"):
        for symbol in program.operations:
            operands = [value(operand) for operand in symbol.operands]
            found[symbol.index] = _result(symbol.operation, operands)
    return [value(output) for output in program.outputs]


def _result(operation: str, operands: Values) -> Any:
    if operation == "item":
        results, number = operands
        return results[number]
    if operation in {"loop", "branch"}:
        nested, *given = operands
        rows = np.broadcast_arrays(*given)
        one = _repeated if operation == "loop" else _branched
        samples = [one(nested, [row[k] for row in rows]) for k in range(len(rows[0]))]
        columns = [np.array(column) for column in zip(*samples, strict=True)]
        return dict(zip(nested.indices, columns, strict=True))
    return MEANING.get(operation, getattr(np, operation, None))(*operands)


def _repeated(loop: Any, entries: Values) -> Values:
    """One sample through a loop."""
    count = len(loop.body.outputs) - 1
    state, constants = entries[:count], entries[count:]
    for _ in range(loop.limit):
        *state, done = _single(loop.body, [*state, *constants])
        if done:
            break
    return state


def _branched(branch: Any, entries: Values) -> Values:
    """One sample through a branch."""
    count = len(branch.body.outputs)
    truth, otherwise, arguments = entries[0], entries[1 : 1 + count], entries[1 + count :]
    return _single(branch.body, arguments) if truth else otherwise


def _single(program: Program, entries: Values) -> Values:
    outputs = carry_out(program, [np.array([entry]) for entry in entries])
    return [np.ravel(output)[0] for output in outputs]
