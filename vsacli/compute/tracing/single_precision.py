"""Programs run in single precision by NumPy, to predict the values of C code with type float."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import FLAG_TYPE, FloatArray
from vsacli.compute.rounding import single_constant
from vsacli.compute.tracing.program import (
    FUNCTIONS,
    Branch,
    Call,
    Kind,
    Loop,
    Program,
    SelectionTable,
    Subroutine,
    Symbol,
    kind_of,
    kinds_of_operands,
)

Values = list[Any]
"""Rows of samples, or constants of NumPy types."""

Results = dict[int, Any]
"""Values that a nested program returns, by index."""

_DTYPES: dict[Kind, type[np.generic]] = {
    Kind.REAL: np.float32,
    Kind.TRUTH: np.bool_,
    Kind.BITS: FLAG_TYPE,
    Kind.INDEX: np.intp,
}


def run_in_single_precision(
    program: Program, rows: Sequence[FloatArray] | FloatArray
) -> list[npt.NDArray[Any]]:
    """Run a program with rounding to single precision after each operation.

    Functions are computed in double precision and then rounded: `math.h` is within a unit in the last place
    of that, whereas the accuracy of NumPy's functions in single precision depends on the processor.

    Args:
        program: Program.
        rows: Inputs of the program, (samples,), which are rounded, too.

    Returns:
        Outputs of the program, (samples,): single precision numbers, Booleans or bits.
    """
    with np.errstate(all="ignore"):
        outputs = _run_program(program, [np.asarray(row, dtype=np.float32) for row in rows])
    return [np.broadcast_to(output, len(rows[0])) for output in outputs]


def _run_program(program: Program, inputs: Values) -> Values:
    values: dict[int, Any] = {symbol.index: row for symbol, row in zip(program.inputs, inputs, strict=True)}

    def operand_value(operand: Any, kind: Kind) -> Any:
        if isinstance(operand, Symbol):
            return values[operand.index]
        return _typed_constant(operand, kind) if isinstance(operand, float | int) else operand

    for symbol in program.operations:
        operands = map(operand_value, symbol.operands, kinds_of_operands(symbol))
        values[symbol.index] = _operation_result(symbol.operation, list(operands))
    return [operand_value(output, kind_of(output)) for output in program.outputs]


def _typed_constant(number: float | int | bool, kind: Kind) -> np.generic:
    return _DTYPES[kind](single_constant(number) if kind is Kind.REAL else number)


def _operation_result(operation: str, operands: Values) -> Any:
    if operation in _OPERATIONS:
        return _OPERATIONS[operation](*operands)
    function = getattr(np, operation)
    if operation in FUNCTIONS:
        return function(*(np.float64(operand) for operand in operands)).astype(np.float32)
    return function(*operands)


def _run_loop(loop: Loop, *operands: Any) -> Results:
    # Samples that are done keep their state while the others continue.
    state_size = len(loop.indices)
    state, constants = list(operands[:state_size]), operands[state_size:]
    running: Any = np.bool_(True)
    for _ in range(loop.limit):
        *next_state, done = _run_program(loop.body, [*state, *constants])
        state = [np.where(running, *pair) for pair in zip(next_state, state, strict=True)]
        running = running & ~done
        if not running.any():
            break
    return dict(zip(loop.indices, state, strict=True))


def _run_branch(branch: Branch, truth: Any, *operands: Any) -> Results:
    output_count = len(branch.indices)
    values = list(operands[:output_count])
    if np.any(truth):
        results = _run_program(branch.body, list(operands[output_count:]))
        values = [np.where(truth, *pair) for pair in zip(results, values, strict=True)]
    return dict(zip(branch.indices, values, strict=True))


def _run_call(call: Call, *operands: Any) -> Results:
    return dict(zip(call.indices, _run_program(call.body, list(operands)), strict=True))


def _run_subroutine(subroutine: Subroutine, *operands: Any) -> Results:
    return dict(enumerate(_run_program(subroutine.body, list(operands))))


def _table_entries(table: SelectionTable) -> FloatArray:
    return np.array([single_constant(value) for value in table.values], dtype=np.float32)


_OPERATIONS: dict[str, Callable[..., Any]] = {
    "bits": lambda truth, mask: np.where(truth, mask, FLAG_TYPE(0)),
    "branch": _run_branch,
    "call": _run_call,
    "item": lambda results, number: results[number],
    "loop": _run_loop,
    "searchsorted": lambda table, values: np.searchsorted(_table_entries(table), values, side="right"),
    "subroutine": _run_subroutine,
    "take": lambda table, index: _table_entries(table)[index],
}
"""Operations that NumPy has no function for."""
