"""NumPy's functions on arrays of symbols and constants."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt

from vsacli.compute.tracing.program import BITWISE, Kind, Operand, Symbol, Table
from vsacli.compute.tracing.tape import Tape

Cells = npt.NDArray[np.object_]


def apply_ufunc(
    tape: Tape, ufunc: np.ufunc, method: str, operands: Sequence[Cells], options: Mapping[str, Any]
) -> Any:
    """What `ufunc(*operands)`, or `ufunc.reduce(operand, axis=...)`, leaves: symbols and constants."""
    if ufunc is np.matmul:
        return _matmul(tape, *operands)
    if method == "reduce":
        rows = np.moveaxis(operands[0], options.get("axis", 0) or 0, 0)
        return reduce(lambda a, b: elementwise(tape, ufunc, a, b), rows)
    if method != "__call__" or ufunc.nout != 1 or set(options) - {"dtype"}:
        raise NotImplementedError(f"numpy.{ufunc.__name__} cannot be recorded in this way")
    return elementwise(tape, ufunc, *operands)


def elementwise(tape: Tape, ufunc: np.ufunc, *operands: Cells) -> Cells:
    """A function on each entry."""
    if all(cells.size == 1 for cells in operands):
        single = np.empty(max((cells.shape for cells in operands), key=len), dtype=object)
        single[...] = _one(tape, ufunc, *(cells.item() for cells in operands))
        return single
    return each_entry(lambda *entries: _one(tape, ufunc, *entries), *operands)


def each_entry(function: Callable[..., Operand], *operands: Any) -> Cells:
    """A function of single entries on all of some arrays."""
    spread = np.broadcast_arrays(*(np.asarray(cells, dtype=object) for cells in operands))
    result = np.empty(spread[0].size, dtype=object)
    result[:] = [function(*entries) for entries in zip(*(cells.flat for cells in spread), strict=True)]
    return result.reshape(spread[0].shape)


def _one(tape: Tape, ufunc: np.ufunc, *operands: Operand) -> Operand:
    """A function of symbols or constants."""
    if not any(isinstance(operand, Symbol) for operand in operands):
        with np.errstate(all="ignore"):
            number: Operand = ufunc(*operands).item()
        return number
    name = ufunc.__name__
    if name in _COMPOSED:
        return _COMPOSED[name](tape, *operands)
    if name in BITWISE and _any_truth(operands):
        name = f"logical_{BITWISE[name]}"
    if name == "multiply" and (shifted := _scaled_bits(tape, operands)) is not None:
        return shifted
    return tape.emit(name, *operands)


def _any_truth(operands: Sequence[Operand]) -> bool:
    return any(
        isinstance(operand, bool) or (isinstance(operand, Symbol) and operand.kind is Kind.TRUTH)
        for operand in operands
    )


def _scaled_bits(tape: Tape, operands: Sequence[Operand]) -> Operand | None:
    """A truth value as integer, times a constant."""
    for symbol, factor in (operands, operands[::-1]):
        if isinstance(symbol, Symbol) and symbol.operation == "bits":
            truth, mask = symbol.operands
            return tape.emit("bits", truth, mask * factor)
    return None


def _power(tape: Tape, base: Operand, exponent: Operand) -> Operand:
    """By products where the exponent is a small whole number, or 1.5."""
    if exponent == 1.5:
        return tape.emit("multiply", base, tape.emit("sqrt", base))
    if exponent not in (2, 3, 4):
        return tape.emit("power", base, exponent)
    square = tape.emit("multiply", base, base)
    if exponent == 2:
        return square
    return tape.emit("multiply", square, base if exponent == 3 else square)


def _isfinite(tape: Tape, a: Operand) -> Operand:
    return tape.emit("less", tape.emit("absolute", a), float("inf"))


def _isinf(tape: Tape, a: Operand) -> Operand:
    return tape.emit("equal", tape.emit("absolute", a), float("inf"))


_COMPOSED: dict[str, Callable[..., Operand]] = {
    "power": _power,
    "float_power": _power,
    "square": lambda tape, a: tape.emit("multiply", a, a),
    "reciprocal": lambda tape, a: tape.emit("divide", 1.0, a),
    "positive": lambda _tape, a: a,
    "fabs": lambda tape, a: tape.emit("absolute", a),
    "isfinite": _isfinite,
    "isinf": _isinf,
}
"""Functions that are recorded by means of others."""


def _matmul(tape: Tape, a: Cells, b: Cells) -> Cells:
    """Matrix product; zeros of a constant matrix are taken as the absence of a term."""

    def dot(row: Cells, column: Cells) -> Operand:
        pairs = [pair for pair in zip(row, column, strict=True) if 0 not in pair]
        products = [_one(tape, np.multiply, *pair) for pair in pairs]
        return reduce(lambda total, term: _one(tape, np.add, total, term), products) if products else 0.0

    result = [[dot(row, column) for column in b.reshape(len(b), -1).T] for row in np.atleast_2d(a)]
    return np.array(result, dtype=object).reshape(*a.shape[:-1], *b.shape[1:])


ARRANGING: frozenset[Callable[..., Any]] = frozenset(
    {
        *(np.stack, np.concatenate, np.broadcast_to, np.moveaxis, np.transpose, np.reshape, np.ravel),
        *(np.full_like, np.zeros_like, np.ones_like, np.empty_like, np.atleast_1d, np.shape, np.ndim),
        *(np.diag, np.diagonal, np.copy),
    }
)
"""Functions that only arrange entries, whatever these are."""


def _where(tape: Tape, truth: Any, a: Any, b: Any) -> Cells:
    if any(np.asarray(argument).dtype.kind == "u" for argument in (a, b)):
        raise NotImplementedError("bits are recorded as set or not: truth.astype(numpy.uint16) * bits")
    return each_entry(lambda *entries: _choice(tape, *entries), truth, a, b)


def _choice(tape: Tape, truth: Operand, a: Operand, b: Operand) -> Operand:
    if not isinstance(truth, Symbol):
        return a if truth else b
    return tape.emit("where", truth, a, b)


def _clip(tape: Tape, values: Any, low: Any, high: Any) -> Cells:
    raised = elementwise(tape, np.maximum, *map(_objects, (values, low)))
    return elementwise(tape, np.minimum, raised, _objects(high))


def _searchsorted(tape: Tape, nodes: Any, values: Any, *, side: str = "left") -> Cells:
    if side != "right":
        raise NotImplementedError("numpy.searchsorted is recorded with side='right' only")
    table = Table(tuple(np.asarray(nodes, dtype=np.float64).tolist()))
    return each_entry(lambda cell: tape.emit("searchsorted", table, cell), values)


def _objects(argument: Any) -> Cells:
    return np.asarray(argument, dtype=object)


FUNCTIONS: dict[Callable[..., Any], Callable[..., Cells]] = {
    np.where: _where,
    np.clip: _clip,
    np.searchsorted: _searchsorted,
}
"""Functions of entries."""
