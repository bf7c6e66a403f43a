"""Arrays of symbols and constants that NumPy's functions accept, so that one text computes and is traced."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.lib.mixins import NDArrayOperatorsMixin

from vsacli.compute.tracing.numpy_functions import ARRANGING, FUNCTIONS, Cells, apply_ufunc
from vsacli.compute.tracing.program import Kind, Operand, Program, Symbol
from vsacli.compute.tracing.tape import Tape, TooLongError


class TracedArray(NDArrayOperatorsMixin):
    """An array whose entries are symbols or constants, by the protocols of NumPy (NEP 13 and 18).

    A row of samples is an array (1,): what NumPy broadcasts along samples is broadcast along the one.

    Attributes:
        tape: where operations go.
        cells: the entries.
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
            return TracedArray(self.tape, FUNCTIONS[function](self.tape, *_unpacked(arguments), **options))
        if function not in ARRANGING:
            raise NotImplementedError(f"numpy.{function.__name__} cannot be recorded")
        result = function(
            *_unpacked(arguments), **{name: _unpacked(value) for name, value in options.items()}
        )
        return TracedArray(self.tape, result) if isinstance(result, np.ndarray) else result

    def __getitem__(self, index: Any) -> TracedArray:
        return TracedArray(self.tape, self.cells[_index(index)])

    def __setitem__(self, index: Any, value: Any) -> None:
        self.cells[_index(index)] = cells_of(value)

    def __iter__(self) -> Iterator[TracedArray]:
        return (self[index] for index in range(len(self)))

    def __len__(self) -> int:
        return len(self.cells)

    def __bool__(self) -> bool:
        return bool(self._known())

    def __float__(self) -> float:
        return float(self._known().item())

    def __hash__(self) -> int:
        return hash(float(self))

    def _known(self) -> Cells:
        """The entries, if all of them are constants."""
        if any(isinstance(cell, Symbol) for cell in self.cells.flat):
            raise NotImplementedError(
                "what is known only when the program runs cannot decide what is recorded"
            )
        return self.cells

    @property
    def shape(self) -> tuple[int, ...]:
        """As of an array."""
        return self.cells.shape

    @property
    def ndim(self) -> int:
        """As of an array."""
        return self.cells.ndim

    @property
    def size(self) -> int:
        """As of an array."""
        return self.cells.size

    @property
    def T(self) -> TracedArray:  # noqa: N802  (NumPy's name)
        """As of an array."""
        return TracedArray(self.tape, self.cells.T)

    def astype(self, dtype: npt.DTypeLike) -> TracedArray:
        """As of an array; truth values become the lowest bit of an unsigned integer."""
        wanted = np.dtype(dtype).kind
        return TracedArray(
            self.tape, np.vectorize(lambda cell: self._cast(cell, wanted), otypes=[object])(self.cells)
        )

    def _cast(self, cell: Operand, wanted: str) -> Operand:
        if isinstance(cell, Symbol):
            if cell.kind is Kind.TRUTH and wanted == "u":
                return self.tape.emit("bits", cell, 1)
            if (cell.kind, wanted) in {(Kind.REAL, "f"), (Kind.TRUTH, "b"), (Kind.BITS, "u")}:
                return cell
            raise NotImplementedError(f"no conversion of {cell.kind} to the NumPy kind {wanted!r}")
        return _CASTS[wanted](cell)

    def copy(self) -> TracedArray:
        """As of an array."""
        return TracedArray(self.tape, self.cells.copy())

    def sum(self, axis: int | None = None) -> TracedArray:
        """As of an array."""
        return TracedArray(self.tape, np.sum(self.cells, axis=axis))

    def ravel(self) -> TracedArray:
        """As of an array."""
        return TracedArray(self.tape, self.cells.ravel())

    def reshape(self, *shape: int) -> TracedArray:
        """As of an array."""
        return TracedArray(self.tape, self.cells.reshape(*shape))


_CASTS: dict[str, Callable[[float], Operand]] = {"u": int, "f": float, "b": bool}


def cells_of(array: Any) -> Cells:
    """The entries of an array, traced or not, as symbols and Python's numbers."""
    if isinstance(array, TracedArray):
        return array.cells
    return np.asarray(array, dtype=object)


def _unpacked(argument: Any) -> Any:
    """Cells in place of traced arrays, inside of lists and tuples also."""
    if isinstance(argument, TracedArray):
        return argument.cells
    if isinstance(argument, list | tuple):
        return type(argument)(map(_unpacked, argument))
    return argument


def _index(index: Any) -> Any:
    """An index; of traced arrays only truth values that do not depend on a sample."""
    return index._known().astype(bool) if isinstance(index, TracedArray) else index


def trace(
    function: Callable[[Sequence[Any]], Sequence[Any]],
    kinds: Sequence[Kind],
    most: int = sys.maxsize,
    *,
    calling: bool = False,
    short: bool = False,
) -> Program:
    """The program of a function of rows of samples: what it does to one sample.

    Args:
        function: from rows of samples to rows of results; each sample is computed by itself.
        kinds: of the rows that it takes.
        most: operations that are recorded.
        calling: whether calls are recorded as such, else what they do.
        short: whether subroutines are functions of their own.

    Raises:
        NotImplementedError: it has no such program, or, as `TooLongError`, one of more operations.
    """
    tape = Tape(most, calling, short)
    rows = [TracedArray(tape, [tape.input(kind)]) for kind in kinds]
    return tape.program([cells_of(result).item() for result in function(rows)])


def trace_by_size(
    function: Callable[[Sequence[Any]], Sequence[Any]],
    kinds: Sequence[Kind],
    written_out: int,
    most: int = sys.maxsize,
    *,
    short: bool = False,
) -> Program:
    """The program of a function, as of `trace`: written out if it is short, else of calls.

    Args:
        function: as of `trace`.
        kinds: as of `trace`.
        written_out: operations of the longest program that is written out.
        most: operations, calls among them, of the longest other program.
        short: as of `trace`.

    Raises:
        NotImplementedError: as of `trace`.
    """
    try:
        return trace(function, kinds, written_out, short=short)
    except TooLongError:
        return trace(function, kinds, most, calling=True, short=short)
