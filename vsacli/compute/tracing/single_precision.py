"""Programs run in single precision by NumPy, to predict the values of C code with type float."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import FLAG_TYPE, FloatArray
from vsacli.compute.rounding import single
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


def in_single_precision(program: Program, rows: Sequence[FloatArray] | FloatArray) -> list[npt.NDArray[Any]]:
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
        outputs = _run(program, [np.asarray(row, dtype=np.float32) for row in rows])
    return [np.broadcast_to(output, len(rows[0])) for output in outputs]


def _run(program: Program, inputs: Values) -> Values:
    found: dict[int, Any] = {symbol.index: row for symbol, row in zip(program.inputs, inputs, strict=True)}

    def value(operand: Any, kind: Kind) -> Any:
        if isinstance(operand, Symbol):
            return found[operand.index]
        return _constant(operand, kind) if isinstance(operand, float | int) else operand

    for symbol in program.operations:
        operands = map(value, symbol.operands, kinds_of_operands(symbol))
        found[symbol.index] = _result(symbol.operation, list(operands))
    return [value(output, kind_of(output)) for output in program.outputs]


def _constant(number: float | int | bool, kind: Kind) -> np.generic:
    return _DTYPES[kind](single(number) if kind is Kind.REAL else number)


def _result(operation: str, operands: Values) -> Any:
    if operation in _MEANING:
        return _MEANING[operation](*operands)
    function = getattr(np, operation)
    if operation in FUNCTIONS:
        return function(*(np.float64(operand) for operand in operands)).astype(np.float32)
    return function(*operands)


def _loop(loop: Loop, *operands: Any) -> Results:
    # Samples that are done keep their state while the others continue.
    count = len(loop.numbers)
    state, constants = list(operands[:count]), operands[count:]
    going: Any = np.bool_(True)
    for _ in range(loop.limit):
        *following, done = _run(loop.body, [*state, *constants])
        state = [np.where(going, *pair) for pair in zip(following, state, strict=True)]
        going = going & ~done
        if not going.any():
            break
    return dict(zip(loop.numbers, state, strict=True))


def _branch(branch: Branch, truth: Any, *operands: Any) -> Results:
    count = len(branch.numbers)
    values = list(operands[:count])
    if np.any(truth):
        found = _run(branch.body, list(operands[count:]))
        values = [np.where(truth, *pair) for pair in zip(found, values, strict=True)]
    return dict(zip(branch.numbers, values, strict=True))


def _call(call: Call, *operands: Any) -> Results:
    return dict(zip(call.numbers, _run(call.body, list(operands)), strict=True))


def _subroutine(subroutine: Subroutine, *operands: Any) -> Results:
    return dict(enumerate(_run(subroutine.body, list(operands))))


def _entries(table: SelectionTable) -> FloatArray:
    return np.array([single(value) for value in table.values], dtype=np.float32)


_MEANING: dict[str, Callable[..., Any]] = {
    "bits": lambda truth, mask: np.where(truth, mask, FLAG_TYPE(0)),
    "branch": _branch,
    "call": _call,
    "item": lambda results, number: results[number],
    "loop": _loop,
    "searchsorted": lambda table, values: np.searchsorted(_entries(table), values, side="right"),
    "subroutine": _subroutine,
    "take": lambda table, index: _entries(table)[index],
}
"""Operations that NumPy has no function for."""
