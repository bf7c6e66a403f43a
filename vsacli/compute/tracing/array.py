"""Arrays of symbols and constants that NumPy's functions accept, so that a kernel is traced as it is."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.lib.mixins import NDArrayOperatorsMixin

from vsacli.compute.tracing.program import BITWISE, Kind, Operand, Program, SelectionTable, Symbol
from vsacli.compute.tracing.tape import Tape, TooLongError

Cells = npt.NDArray[np.object_]


def apply_ufunc(
    tape: Tape, ufunc: np.ufunc, method: str, operands: Sequence[Cells], options: Mapping[str, Any]
) -> Any:
    """Return the entries of `ufunc(*operands)`, or of `ufunc.reduce(operand, axis=...)`."""
    if ufunc is np.matmul:
        return _record_matmul(tape, *operands)
    if method == "reduce":
        rows = np.moveaxis(operands[0], options.get("axis", 0) or 0, 0)
        return reduce(lambda a, b: elementwise(tape, ufunc, a, b), rows)
    if method != "__call__" or ufunc.nout != 1 or set(options) - {"dtype"}:
        raise NotImplementedError(f"numpy.{ufunc.__name__} cannot be recorded in this way")
    return elementwise(tape, ufunc, *operands)


def elementwise(tape: Tape, ufunc: np.ufunc, *operands: Cells) -> Cells:
    """Return a ufunc of arrays, entry by entry."""
    if all(cells.size == 1 for cells in operands):
        result = np.empty(max((cells.shape for cells in operands), key=len), dtype=object)
        result[...] = _record_scalar(tape, ufunc, *(cells.item() for cells in operands))
        return result
    return each_entry(lambda *entries: _record_scalar(tape, ufunc, *entries), *operands)


def each_entry(function: Callable[..., Operand], *operands: Any) -> Cells:
    """Return a function of scalars, applied to each entry of arrays."""
    broadcast = np.broadcast_arrays(*(np.asarray(cells, dtype=object) for cells in operands))
    result = np.empty(broadcast[0].size, dtype=object)
    result[:] = [function(*entries) for entries in zip(*(cells.flat for cells in broadcast), strict=True)]
    return result.reshape(broadcast[0].shape)


def _record_scalar(tape: Tape, ufunc: np.ufunc, *operands: Operand) -> Operand:
    """Return a ufunc of symbols or constants."""
    if not any(isinstance(operand, Symbol) for operand in operands):
        with np.errstate(all="ignore"):
            number: Operand = ufunc(*operands).item()
        return number
    operation = ufunc.__name__
    if operation in _COMPOSED:
        return _COMPOSED[operation](tape, *operands)
    if operation in BITWISE and _any_truth(operands):
        operation = f"logical_{BITWISE[operation]}"
    if operation == "multiply" and (scaled := _scaled_bits(tape, operands)) is not None:
        return scaled
    return tape.emit(operation, *operands)


def _any_truth(operands: Sequence[Operand]) -> bool:
    return any(
        isinstance(operand, bool) or (isinstance(operand, Symbol) and operand.kind is Kind.TRUTH)
        for operand in operands
    )


def _scaled_bits(tape: Tape, operands: Sequence[Operand]) -> Operand | None:
    """Return `bits` times a factor, as `bits` with the scaled mask; None for other operands."""
    for symbol, factor in (operands, operands[::-1]):
        if isinstance(symbol, Symbol) and symbol.operation == "bits":
            truth, mask = symbol.operands
            return tape.emit("bits", truth, mask * factor)
    return None


def _record_power(tape: Tape, base: Operand, exponent: Operand) -> Operand:
    """Return a power, as products if the exponent is a small integer or 1.5."""
    if exponent == 1.5:
        return tape.emit("multiply", base, tape.emit("sqrt", base))
    if exponent not in (2, 3, 4):
        return tape.emit("power", base, exponent)
    square = tape.emit("multiply", base, base)
    if exponent == 2:
        return square
    return tape.emit("multiply", square, base if exponent == 3 else square)


def _record_isfinite(tape: Tape, a: Operand) -> Operand:
    return tape.emit("less", tape.emit("absolute", a), float("inf"))


def _record_isinf(tape: Tape, a: Operand) -> Operand:
    return tape.emit("equal", tape.emit("absolute", a), float("inf"))


_COMPOSED: dict[str, Callable[..., Operand]] = {
    "power": _record_power,
    "float_power": _record_power,
    "square": lambda tape, a: tape.emit("multiply", a, a),
    "reciprocal": lambda tape, a: tape.emit("divide", 1.0, a),
    "positive": lambda _tape, a: a,
    "fabs": lambda tape, a: tape.emit("absolute", a),
    "isfinite": _record_isfinite,
    "isinf": _record_isinf,
}
"""Functions that are recorded as several operations."""


def _record_matmul(tape: Tape, a: Cells, b: Cells) -> Cells:
    """Return the matrix product; zeros of a constant matrix add no term."""

    def dot(row: Cells, column: Cells) -> Operand:
        pairs = [pair for pair in zip(row, column, strict=True) if 0 not in pair]
        products = [_record_scalar(tape, np.multiply, *pair) for pair in pairs]
        return (
            reduce(lambda total, term: _record_scalar(tape, np.add, total, term), products)
            if products
            else 0.0
        )

    result = [[dot(row, column) for column in b.reshape(len(b), -1).T] for row in np.atleast_2d(a)]
    return np.array(result, dtype=object).reshape(*a.shape[:-1], *b.shape[1:])


ARRANGING: frozenset[Callable[..., Any]] = frozenset(
    {
        *(np.stack, np.concatenate, np.broadcast_to, np.moveaxis, np.transpose, np.reshape, np.ravel),
        *(np.full_like, np.zeros_like, np.ones_like, np.empty_like, np.atleast_1d, np.shape, np.ndim),
        *(np.diag, np.diagonal, np.copy),
    }
)
"""Functions that only rearrange entries."""


def _record_where(tape: Tape, truth: Any, a: Any, b: Any) -> Cells:
    if any(np.asarray(argument).dtype.kind == "u" for argument in (a, b)):
        raise NotImplementedError("bits are recorded as set or not: truth.astype(FLAG_TYPE) * bits")
    return each_entry(lambda *entries: _record_choice(tape, *entries), truth, a, b)


def _record_choice(tape: Tape, truth: Operand, a: Operand, b: Operand) -> Operand:
    if not isinstance(truth, Symbol):
        return a if truth else b
    return tape.emit("where", truth, a, b)


def _record_clip(tape: Tape, values: Any, low: Any, high: Any) -> Cells:
    clipped_below = elementwise(tape, np.maximum, *map(_object_array, (values, low)))
    return elementwise(tape, np.minimum, clipped_below, _object_array(high))


def _record_searchsorted(tape: Tape, nodes: Any, values: Any, *, side: str = "left") -> Cells:
    if side != "right":
        raise NotImplementedError("numpy.searchsorted is recorded with side='right' only")
    table = SelectionTable(tuple(np.asarray(nodes, dtype=np.float64).tolist()))
    return each_entry(lambda cell: tape.emit("searchsorted", table, cell), values)


def _object_array(argument: Any) -> Cells:
    return np.asarray(argument, dtype=object)


FUNCTIONS: dict[Callable[..., Any], Callable[..., Cells]] = {
    np.where: _record_where,
    np.clip: _record_clip,
    np.searchsorted: _record_searchsorted,
}
"""Functions that compute entries."""


class TracedArray(NDArrayOperatorsMixin):
    """An array whose entries are symbols or constants, by the protocols of NumPy (NEP 13 and 18).

    A row of samples is an array (1,): broadcasting along samples becomes broadcasting along this axis.

    Attributes:
        tape: Tape that records the operations.
        cells: Entries.
    """

    def __init__(self, tape: Tape, cells: Any) -> None:
        self.tape = tape
        self.cells: Cells = np.asarray(cells, dtype=object)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> TracedArray:
        out = options.pop("out", (None,))[0]
        cells = apply_ufunc(self.tape, ufunc, method, [cells_of(array) for array in inputs], options)
        if out is None:
            return TracedArray(self.tape, cells)
        if not isinstance(out, TracedArray):
            raise TypeError("an array of numbers cannot take in what is known only when the program runs")
        out.cells[...] = cells
        return out

    def __array_function__(
        self, function: Callable[..., Any], _types: Any, arguments: tuple[Any, ...], options: dict[str, Any]
    ) -> Any:
        if function in FUNCTIONS:
            return TracedArray(self.tape, FUNCTIONS[function](self.tape, *_untraced(arguments), **options))
        if function not in ARRANGING:
            raise NotImplementedError(f"numpy.{function.__name__} cannot be recorded")
        result = function(
            *_untraced(arguments), **{name: _untraced(value) for name, value in options.items()}
        )
        return TracedArray(self.tape, result) if isinstance(result, np.ndarray) else result

    def __getitem__(self, index: Any) -> TracedArray:
        return TracedArray(self.tape, self.cells[_untraced_index(index)])

    def __setitem__(self, index: Any, value: Any) -> None:
        self.cells[_untraced_index(index)] = cells_of(value)

    def __iter__(self) -> Iterator[TracedArray]:
        return (self[index] for index in range(len(self)))

    def __len__(self) -> int:
        return len(self.cells)

    def __bool__(self) -> bool:
        return bool(self._constant_cells())

    def __float__(self) -> float:
        return float(self._constant_cells().item())

    def __hash__(self) -> int:
        return hash(float(self))

    def _constant_cells(self) -> Cells:
        """Return the entries, if all of them are constants."""
        if any(isinstance(cell, Symbol) for cell in self.cells.flat):
            raise NotImplementedError(
                "what is known only when the program runs cannot decide what is recorded"
            )
        return self.cells

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape."""
        return self.cells.shape

    @property
    def ndim(self) -> int:
        """Dimensions."""
        return self.cells.ndim

    @property
    def size(self) -> int:
        """Size."""
        return self.cells.size

    @property
    def T(self) -> TracedArray:  # noqa: N802  (NumPy's name)
        """Transpose."""
        return TracedArray(self.tape, self.cells.T)

    def astype(self, dtype: npt.DTypeLike) -> TracedArray:
        """Return the array with another type; a Boolean becomes the lowest bit of an unsigned integer."""
        dtype_kind = np.dtype(dtype).kind
        return TracedArray(
            self.tape, np.vectorize(lambda cell: self._cast(cell, dtype_kind), otypes=[object])(self.cells)
        )

    def _cast(self, cell: Operand, dtype_kind: str) -> Operand:
        if isinstance(cell, Symbol):
            if cell.kind is Kind.TRUTH and dtype_kind == "u":
                return self.tape.emit("bits", cell, 1)
            if (cell.kind, dtype_kind) in {(Kind.REAL, "f"), (Kind.TRUTH, "b"), (Kind.BITS, "u")}:
                return cell
            raise NotImplementedError(f"no conversion of {cell.kind} to the NumPy kind {dtype_kind!r}")
        return _CASTS[dtype_kind](cell)

    def copy(self) -> TracedArray:
        """Return a copy."""
        return TracedArray(self.tape, self.cells.copy())

    def sum(self, axis: int | None = None) -> TracedArray:
        """Return the sum along an axis, or of all entries."""
        return TracedArray(self.tape, np.sum(self.cells, axis=axis))

    def ravel(self) -> TracedArray:
        """Return the entries as one row."""
        return TracedArray(self.tape, self.cells.ravel())

    def reshape(self, *shape: int) -> TracedArray:
        """Return the array in another shape."""
        return TracedArray(self.tape, self.cells.reshape(*shape))


_CASTS: dict[str, Callable[[float], Operand]] = {"u": int, "f": float, "b": bool}


def cells_of(array: Any) -> Cells:
    """Return the entries of an array, traced or not, as symbols and Python numbers."""
    if isinstance(array, TracedArray):
        return array.cells
    return np.asarray(array, dtype=object)


def _untraced(argument: Any) -> Any:
    """Return cells in place of traced arrays, also inside lists and tuples."""
    if isinstance(argument, TracedArray):
        return argument.cells
    if isinstance(argument, list | tuple):
        return type(argument)(map(_untraced, argument))
    return argument


def _untraced_index(index: Any) -> Any:
    """Return an index; a traced array is allowed only if it consists of constant Booleans."""
    return index._constant_cells().astype(bool) if isinstance(index, TracedArray) else index


def trace(
    function: Callable[[Sequence[Any]], Sequence[Any]],
    kinds: Sequence[Kind],
    max_operations: int = sys.maxsize,
    *,
    calling: bool = False,
    short: bool = False,
    conditional: int | None = None,
) -> Program:
    """Return the program of a function of rows of samples, for one sample.

    Args:
        function: Function from rows of samples to rows of results; each sample is computed independently.
        kinds: Kinds of the input rows.
        max_operations: Largest number of operations.
        calling: Whether calls are recorded as such, or expanded.
        short: Whether subroutines are separate functions.
        conditional: See `Tape`.

    Raises:
        NotImplementedError: The function cannot be traced; `TooLongError` if it has more operations.
    """
    tape = Tape(max_operations, calling, short, conditional)
    rows = [TracedArray(tape, [tape.input(kind)]) for kind in kinds]
    return tape.program([cells_of(result).item() for result in function(rows)])


def trace_by_size(
    function: Callable[[Sequence[Any]], Sequence[Any]],
    kinds: Sequence[Kind],
    written_out: int,
    max_operations: int = sys.maxsize,
    *,
    short: bool = False,
    conditional: int | None = None,
) -> Program:
    """Return the program of a function, as `trace` does: without calls if it is short, else of calls.

    Args:
        function: See `trace`.
        kinds: See `trace`.
        written_out: Largest number of operations of a program without calls.
        max_operations: Largest number of operations, including calls, of another program.
        short: See `trace`.
        conditional: See `Tape`; applies to programs without calls.

    Raises:
        NotImplementedError: See `trace`.
    """
    try:
        return trace(function, kinds, written_out, short=short, conditional=conditional)
    except TooLongError:
        return trace(function, kinds, max_operations, calling=True, short=short)
