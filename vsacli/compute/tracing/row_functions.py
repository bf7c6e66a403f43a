"""Programs on rows of samples, with one NumPy call per operation, on reused rows.

`RowFunction` runs a program without loops and tables: each value has a row, which is reused once the value is
dead, so that the rows stay in the processor's cache. `CallingRowFunction` runs a program of calls, each body
of which is a `RowFunction`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import FLAG_TYPE, FloatArray
from vsacli.compute.tracing.calls import Workspace
from vsacli.compute.tracing.program import CHOOSING, Kind, Operand, Program, Symbol, kind_of
from vsacli.compute.tracing.python_functions import compiled, defined

RowSpace = tuple[npt.NDArray[Any], ...]
"""Rows for intermediate values: of real numbers, of Booleans, of bits."""

DTYPES: dict[Kind, type[np.generic]] = {Kind.REAL: np.float64, Kind.TRUTH: np.bool_, Kind.BITS: FLAG_TYPE}
_LETTERS = {Kind.REAL: "r", Kind.TRUTH: "t", Kind.BITS: "b"}
_NONE_ON_ROWS = {"loop", "branch", "item", "take"}
_SELECTIONS = {"where": "{1}, {2}", "bits": "{1}, 0"}


class RowFunction:
    """A program without loops and tables for rows of any length, with one NumPy call per operation.

    The kernel itself allocates a row for each intermediate value, and computes some of them twice. This does
    neither, so that its rows stay in the processor's cache. Results are those of the program to the last bit.

    Attributes:
        rows: Largest number of intermediate values of each kind kept at a time.
        run: Function of input rows, workspace rows of each kind, and output rows.

    Raises:
        NotImplementedError: The program has loops, branches or tables.
    """

    def __init__(self, program: Program) -> None:
        allocation = _RowAllocation(program)
        head = "def program(inputs, workspace, outputs):"
        text = "\n".join([head, *allocation.heading(), *allocation.statements()])
        names = {**vars(np), **allocation.constants}
        self.run: Callable[..., None] = defined(compiled(text), "program", names)
        self.rows = allocation.counts

    def workspace(self, samples: int) -> RowSpace:
        """Return rows for the intermediate values of at most this many samples."""
        return tuple(np.empty((self.rows[kind], samples), dtype) for kind, dtype in DTYPES.items())

    def __call__(self, rows: Sequence[FloatArray], outputs: FloatArray, workspace: RowSpace) -> None:
        """Compute outputs, (outputs, samples), in place from rows of inputs, (samples,)."""
        samples = len(rows[0])
        with np.errstate(all="ignore"):
            self.run(rows, [values[:, :samples] for values in workspace], outputs)


class _RowAllocation:
    """Rows of a program's values while they are live, as a compiler allocates registers.

    Attributes:
        counts: Number of rows of each kind.
        constants: Constants by name, as arrays (): NumPy would convert each number at every call.
    """

    def __init__(self, program: Program) -> None:
        self._program = program
        self.counts: dict[Kind, int] = defaultdict(int)
        self.constants: dict[str, npt.NDArray[Any]] = {}
        self._constant_names: dict[tuple[Kind, str], str] = {}
        self._free: dict[Kind, list[str]] = defaultdict(list)
        self._row = {symbol.index: f"x{number}" for number, symbol in enumerate(program.inputs)}
        self._last_use = {
            operand.index: number
            for number, symbol in enumerate(program.operations)
            for operand in symbol.operands
            if isinstance(operand, Symbol)
        }
        self._returned = {output.index for output in program.outputs if isinstance(output, Symbol)}
        self._output_row: dict[int, str] = {}
        for number, output in enumerate(program.outputs):
            if isinstance(output, Symbol) and output.kind is Kind.REAL and output.operation != "input":
                self._output_row.setdefault(output.index, f"o{number}")
        self._calls = [line for number in range(len(program.operations)) for line in self._operation(number)]

    def heading(self) -> Iterator[str]:
        """Return statements that assign names to the rows."""
        spaces = ("real", "truth", "bits")
        yield f" {', '.join(spaces)} = workspace"
        yield _unpacking("x", len(self._program.inputs), "inputs")
        yield _unpacking("o", len(self._program.outputs), "outputs")
        for space, (kind, letter) in zip(spaces, _LETTERS.items(), strict=True):
            yield _unpacking(letter, self.counts[kind], space)

    def statements(self) -> Iterator[str]:
        """Return the statements that compute."""
        yield from self._calls
        for number, output in enumerate(self._program.outputs):
            if not (isinstance(output, Symbol) and self._output_row.get(output.index) == f"o{number}"):
                yield f" o{number}[:] = {self._operand(output)}"

    def _operation(self, number: int) -> Iterator[str]:
        symbol = self._program.operations[number]
        if symbol.kind not in DTYPES or symbol.operation in _NONE_ON_ROWS:
            raise NotImplementedError(f"{symbol.operation} has no form on rows")
        operands = [self._operand(operand, symbol.kind) for operand in symbol.operands]
        if symbol.operation in _SELECTIONS:  # written in two steps, so no operand may share the row
            row = self._allocated(symbol)
            one, other = _SELECTIONS[symbol.operation].format(*operands).split(", ")
            yield f" copyto({row}, {other})"
            yield f" copyto({row}, {one}, where={operands[0]})"
            self._free_dead_operands(symbol, number)
        else:
            self._free_dead_operands(symbol, number)
            out = "out=" if symbol.operation in CHOOSING else ""  # slower, but these require the keyword
            yield f" {symbol.operation}({', '.join(operands)}, {out}{self._allocated(symbol)})"

    def _operand(self, operand: Operand, kind: Kind = Kind.REAL) -> str:
        """Return the name of a row, or of a constant in the type of a kind."""
        if isinstance(operand, Symbol):
            return self._row[operand.index]
        kind = kind if kind is Kind.BITS else kind_of(operand)
        name = self._constant_names.setdefault((kind, repr(operand)), f"c{len(self._constant_names)}")
        self.constants[name] = np.array(operand, dtype=DTYPES[kind])
        return name

    def _allocated(self, symbol: Symbol) -> str:
        """Return a row for a value: an output row, a free row, or a new one."""
        row = self._output_row.get(symbol.index)
        if row is None and self._free[symbol.kind]:
            row = self._free[symbol.kind].pop()
        if row is None:
            row = f"{_LETTERS[symbol.kind]}{self.counts[symbol.kind]}"
            self.counts[symbol.kind] += 1
        self._row[symbol.index] = row
        return row

    def _free_dead_operands(self, symbol: Symbol, number: int) -> None:
        """Free the rows of operands that are used neither later nor as an output."""
        for operand in dict.fromkeys(part for part in symbol.operands if isinstance(part, Symbol)):
            dead = self._last_use[operand.index] == number and operand.index not in self._returned
            if dead and operand.operation != "input":
                self._free[operand.kind].append(self._row[operand.index])


def _unpacking(letter: str, count: int, whole: str) -> str:
    return f" ({''.join(f'{letter}{number}, ' for number in range(count))}) = {whole}"


class _RowIndex(NamedTuple):
    """Index of a row among those of its kind; inputs come first."""

    kind: Kind
    place: int


_Source = _RowIndex | npt.NDArray[Any]
"""A row, or a constant as an array ()."""


class _Call(NamedTuple):
    """A call of a function: its arguments, and the places of its results."""

    function: RowFunction
    given: list[_Source]
    results: list[_RowIndex]


class CallingRowFunction:
    """A program of calls on rows of any length; otherwise as `RowFunction`.

    Untraced, 10^5 samples of 20 joints take 1.7 times as long.

    Raises:
        NotImplementedError: The program has loops, branches or tables.
    """

    def __init__(self, program: Program) -> None:
        places = Workspace(program, by_kind=True)
        self._functions: dict[int, RowFunction] = {}
        self._calls = list(self._read(program, places))
        self._outputs = [_source(output, places) for output in program.outputs]
        inputs = {Kind.REAL: len(program.inputs)}
        self._kept = {kind: places.counts[kind] - inputs.get(kind, 0) for kind in DTYPES}

    def _read(self, program: Program, places: Workspace) -> Iterator[_Call]:
        for symbol in program.operations:
            if symbol.operation == "call":
                (body, _), *operands = symbol.operands
                if id(body) not in self._functions:
                    self._functions[id(body)] = RowFunction(body)
                given = [_source(operand, places) for operand in operands]
                results = [_row(result, places) for result in places.results(symbol)]
                yield _Call(self._functions[id(body)], given, results)

    def workspace(self, samples: int) -> RowSpace:
        """Return rows for the arguments and results of calls, and for intermediate values of any function."""
        own = {
            kind: max((function.rows[kind] for function in self._functions.values()), default=0)
            for kind in DTYPES
        }
        return tuple(
            np.empty((self._kept[kind] + own[kind], samples), dtype) for kind, dtype in DTYPES.items()
        )

    def __call__(self, rows: Sequence[FloatArray], outputs: FloatArray, workspace: RowSpace) -> None:
        """Compute outputs, (outputs, samples), in place from rows of inputs, (samples,)."""
        samples = len(rows[0])
        spaces = dict(zip(DTYPES, (space[:, :samples] for space in workspace), strict=True))
        values = {kind: list(space[: self._kept[kind]]) for kind, space in spaces.items()}
        values[Kind.REAL] = [*rows, *values[Kind.REAL]]
        own = {kind: space[self._kept[kind] :] for kind, space in spaces.items()}
        with np.errstate(all="ignore"):
            for function, given, results in self._calls:
                function.run(
                    [_found(source, values) for source in given],
                    [own[kind][: function.rows[kind]] for kind in DTYPES],
                    [values[kind][place] for kind, place in results],
                )
        for output, source in zip(outputs, self._outputs, strict=True):
            output[:] = _found(source, values)


def _found(source: _Source, values: dict[Kind, list[Any]]) -> Any:
    return values[source.kind][source.place] if isinstance(source, _RowIndex) else source


def _source(operand: Operand, places: Workspace) -> _Source:
    if isinstance(operand, Symbol):
        return _row(operand, places)
    return np.array(operand, dtype=np.float64)


def _row(symbol: Symbol, places: Workspace) -> _RowIndex:
    return _RowIndex(symbol.kind, places.slot[symbol.index])
