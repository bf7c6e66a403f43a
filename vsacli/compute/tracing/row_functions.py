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
from vsacli.compute.tracing.python_functions import compile_function, define_function

RowSpace = tuple[npt.NDArray[Any], ...]
"""Rows for intermediate values: of real numbers, of Booleans, of bits."""

DTYPES: dict[Kind, type[np.generic]] = {Kind.REAL: np.float64, Kind.TRUTH: np.bool_, Kind.BITS: FLAG_TYPE}
_LETTERS = {Kind.REAL: "r", Kind.TRUTH: "t", Kind.BITS: "b"}
_NOT_ON_ROWS = {"loop", "branch", "item", "take"}
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
        self.run: Callable[..., None] = define_function(compile_function(text), "program", names)
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
        self._symbol_row = {symbol.index: f"x{position}" for position, symbol in enumerate(program.inputs)}
        self._last_use = {
            operand.index: position
            for position, symbol in enumerate(program.operations)
            for operand in symbol.operands
            if isinstance(operand, Symbol)
        }
        self._output_indices = {output.index for output in program.outputs if isinstance(output, Symbol)}
        self._output_rows: dict[int, str] = {}
        for position, output in enumerate(program.outputs):
            if isinstance(output, Symbol) and output.kind is Kind.REAL and output.operation != "input":
                self._output_rows.setdefault(output.index, f"o{position}")
        self._statements = [
            line for position in range(len(program.operations)) for line in self._operation_lines(position)
        ]

    def heading(self) -> Iterator[str]:
        """Return statements that assign names to the rows."""
        spaces = ("real", "truth", "bits")
        yield f" {', '.join(spaces)} = workspace"
        yield _unpacking_statement("x", len(self._program.inputs), "inputs")
        yield _unpacking_statement("o", len(self._program.outputs), "outputs")
        for space, (kind, letter) in zip(spaces, _LETTERS.items(), strict=True):
            yield _unpacking_statement(letter, self.counts[kind], space)

    def statements(self) -> Iterator[str]:
        """Return the statements that compute."""
        yield from self._statements
        for number, output in enumerate(self._program.outputs):
            if not (isinstance(output, Symbol) and self._output_rows.get(output.index) == f"o{number}"):
                yield f" o{number}[:] = {self._operand_name(output)}"

    def _operation_lines(self, position: int) -> Iterator[str]:
        symbol = self._program.operations[position]
        if symbol.kind not in DTYPES or symbol.operation in _NOT_ON_ROWS:
            raise NotImplementedError(f"{symbol.operation} has no form on rows")
        operands = [self._operand_name(operand, symbol.kind) for operand in symbol.operands]
        if symbol.operation in _SELECTIONS:  # written in two steps, so no operand may share the row
            row = self._allocate_row(symbol)
            true_operand, false_operand = _SELECTIONS[symbol.operation].format(*operands).split(", ")
            yield f" copyto({row}, {false_operand})"
            yield f" copyto({row}, {true_operand}, where={operands[0]})"
            self._free_dead_operands(symbol, position)
        else:
            self._free_dead_operands(symbol, position)
            out = "out=" if symbol.operation in CHOOSING else ""  # slower, but these require the keyword
            yield f" {symbol.operation}({', '.join(operands)}, {out}{self._allocate_row(symbol)})"

    def _operand_name(self, operand: Operand, kind: Kind = Kind.REAL) -> str:
        """Return the name of a row, or of a constant in the type of a kind."""
        if isinstance(operand, Symbol):
            return self._symbol_row[operand.index]
        kind = kind if kind is Kind.BITS else kind_of(operand)
        name = self._constant_names.setdefault((kind, repr(operand)), f"c{len(self._constant_names)}")
        self.constants[name] = np.array(operand, dtype=DTYPES[kind])
        return name

    def _allocate_row(self, symbol: Symbol) -> str:
        """Return a row for a value: an output row, a free row, or a new one."""
        row = self._output_rows.get(symbol.index)
        if row is None and self._free[symbol.kind]:
            row = self._free[symbol.kind].pop()
        if row is None:
            row = f"{_LETTERS[symbol.kind]}{self.counts[symbol.kind]}"
            self.counts[symbol.kind] += 1
        self._symbol_row[symbol.index] = row
        return row

    def _free_dead_operands(self, symbol: Symbol, position: int) -> None:
        """Free the rows of operands that are used neither later nor as an output."""
        for operand in dict.fromkeys(
            operand_symbol for operand_symbol in symbol.operands if isinstance(operand_symbol, Symbol)
        ):
            dead = self._last_use[operand.index] == position and operand.index not in self._output_indices
            if dead and operand.operation != "input":
                self._free[operand.kind].append(self._symbol_row[operand.index])


def _unpacking_statement(letter: str, count: int, sequence: str) -> str:
    return f" ({''.join(f'{letter}{index}, ' for index in range(count))}) = {sequence}"


class _RowIndex(NamedTuple):
    """Index of a row among those of its kind; inputs come first."""

    kind: Kind
    row: int


_Source = _RowIndex | npt.NDArray[Any]
"""A row, or a constant as an array ()."""


class _Call(NamedTuple):
    """A call of a function: its arguments, and the rows of its results."""

    function: RowFunction
    arguments: list[_Source]
    results: list[_RowIndex]


class CallingRowFunction:
    """A program of calls on rows of any length; otherwise as `RowFunction`.

    Untraced, 10^5 samples of 20 joints take 1.7 times as long.

    Raises:
        NotImplementedError: The program has loops, branches or tables.
    """

    def __init__(self, program: Program) -> None:
        allocation = Workspace(program, by_kind=True)
        self._functions: dict[int, RowFunction] = {}
        self._statements = list(self._read_calls(program, allocation))
        self._outputs = [_operand_source(output, allocation) for output in program.outputs]
        inputs = {Kind.REAL: len(program.inputs)}
        self._value_counts = {kind: allocation.counts[kind] - inputs.get(kind, 0) for kind in DTYPES}

    def _read_calls(self, program: Program, allocation: Workspace) -> Iterator[_Call]:
        for symbol in program.operations:
            if symbol.operation == "call":
                (body, _), *operands = symbol.operands
                if id(body) not in self._functions:
                    self._functions[id(body)] = RowFunction(body)
                sources = [_operand_source(operand, allocation) for operand in operands]
                results = [_symbol_row(result, allocation) for result in allocation.results(symbol)]
                yield _Call(self._functions[id(body)], sources, results)

    def workspace(self, samples: int) -> RowSpace:
        """Return rows for the arguments and results of calls, and for intermediate values of any function."""
        most_rows = {
            kind: max((function.rows[kind] for function in self._functions.values()), default=0)
            for kind in DTYPES
        }
        return tuple(
            np.empty((self._value_counts[kind] + most_rows[kind], samples), dtype)
            for kind, dtype in DTYPES.items()
        )

    def __call__(self, rows: Sequence[FloatArray], outputs: FloatArray, workspace: RowSpace) -> None:
        """Compute outputs, (outputs, samples), in place from rows of inputs, (samples,)."""
        samples = len(rows[0])
        spaces = dict(zip(DTYPES, (space[:, :samples] for space in workspace), strict=True))
        values = {kind: list(space[: self._value_counts[kind]]) for kind, space in spaces.items()}
        values[Kind.REAL] = [*rows, *values[Kind.REAL]]
        function_rows = {kind: space[self._value_counts[kind] :] for kind, space in spaces.items()}
        with np.errstate(all="ignore"):
            for function, sources, results in self._statements:
                function.run(
                    [_source_values(source, values) for source in sources],
                    [function_rows[kind][: function.rows[kind]] for kind in DTYPES],
                    [values[kind][row] for kind, row in results],
                )
        for output, source in zip(outputs, self._outputs, strict=True):
            output[:] = _source_values(source, values)


def _source_values(source: _Source, values: dict[Kind, list[Any]]) -> Any:
    return values[source.kind][source.row] if isinstance(source, _RowIndex) else source


def _operand_source(operand: Operand, allocation: Workspace) -> _Source:
    if isinstance(operand, Symbol):
        return _symbol_row(operand, allocation)
    return np.array(operand, dtype=np.float64)


def _symbol_row(symbol: Symbol, allocation: Workspace) -> _RowIndex:
    return _RowIndex(symbol.kind, allocation.slot[symbol.index])
