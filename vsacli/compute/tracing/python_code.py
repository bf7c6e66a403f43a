"""Programs as Python functions: for single states of a simulation, and for long rows of samples."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from types import CodeType, FunctionType
from typing import Any

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import FloatArray, by_joint, over_time
from vsacli.compute.aligned_rows import aligned_rows
from vsacli.compute.tracing.array import TracedArray, cells_of
from vsacli.compute.tracing.program import CHOOSING, Kind, Operand, Program, Symbol, kind_of

_EXPRESSIONS = {
    "add": "{} + {}",
    "subtract": "{} - {}",
    "multiply": "{} * {}",
    "divide": "{} / {}",
    "negative": "-{}",
    **{name: f"{name}({{}})" for name in ("cos", "sin", "tanh")},
}
_ON_NUMBERS = {"cos": math.cos, "sin": math.sin, "tanh": math.tanh}
_ON_ROWS = {"cos": np.cos, "sin": np.sin, "tanh": np.tanh}


class StateFunction:
    """A program of + - * / cos sin tanh for single states, some hundred times faster than its text.

    It takes single numbers or rows of samples, and is compiled to one function without a loop or a branch.
    """

    def __init__(self, program: Program) -> None:
        self.source = _state_source(program)
        code = _compiled(self.source)
        self._on_numbers: Callable[..., list[Any]] = FunctionType(code, dict(_ON_NUMBERS))
        self._on_rows: Callable[..., list[Any]] = FunctionType(code, dict(_ON_ROWS))

    def __call__(self, *inputs: FloatArray) -> FloatArray:
        """Run on arrays (n,) or (samples, n), whose columns are the inputs; the outputs come likewise.

        On traced arrays it becomes part of the program on their tape.
        """
        if isinstance(first := inputs[0], TracedArray):
            entries = np.concatenate([cells_of(array) for array in inputs])
            return TracedArray(first.tape, self._on_rows(*entries))
        if inputs[0].ndim == 1:
            return np.array(self._on_numbers(*(number for array in inputs for number in array.tolist())))
        outputs = self._on_rows(*(row for array in inputs for row in by_joint(array)))
        rows = np.empty((len(outputs), len(inputs[0])))
        for row, output in zip(rows, outputs, strict=True):
            row[:] = output
        return over_time(rows)


def _state_source(program: Program) -> str:
    arguments = ", ".join(map(_name, program.inputs))
    lines = [
        f" {_name(symbol)} = {_EXPRESSIONS[symbol.operation].format(*map(_name, symbol.operands))}"
        for symbol in program.operations
    ]
    results = ", ".join(map(_name, program.outputs))
    return "\n".join([f"def program({arguments}):", *lines, f" return [{results}]"])


def _name(operand: Operand) -> str:
    """Constants exactly."""
    return f"v{operand.index}" if isinstance(operand, Symbol) else repr(operand)


def _compiled(source: str) -> CodeType:
    """The code of the one function in a text."""
    module = compile(source, "<traced program>", "exec")
    return next(constant for constant in module.co_consts if isinstance(constant, CodeType))


RowSpace = tuple[npt.NDArray[Any], ...]
"""Rows for intermediate values: of real numbers, of truth values, of bits."""

DTYPES: dict[Kind, type[np.generic]] = {Kind.REAL: np.float64, Kind.TRUTH: np.bool_, Kind.BITS: np.uint16}
_LETTERS = {Kind.REAL: "r", Kind.TRUTH: "t", Kind.BITS: "b"}
_NONE_ON_ROWS = {"loop", "branch", "item", "take"}
_SELECTIONS = {"where": "{1}, {2}", "bits": "{1}, 0"}


class RowFunction:
    """A program without loops and tables for rows of any length: one call of NumPy an operation.

    What was traced makes a new row for each intermediate value, and computes some of them twice. This does
    neither, so that what it works on stays in the processor's cache; it finds the numbers of its program to
    the last bit.

    Attributes:
        rows: how many intermediate values of each kind are kept at most at a time.
        run: computes, given rows of inputs, the rows of each kind that it needs, and rows for the outputs.

    Raises:
        NotImplementedError: the program has loops, branches or tables.
    """

    def __init__(self, program: Program) -> None:
        allocation = _RowAllocation(program)
        head = "def program(inputs, workspace, outputs):"
        code = _compiled("\n".join([head, *allocation.heading(), *allocation.statements()]))
        self.run: Callable[..., None] = FunctionType(code, {**vars(np), **allocation.constants})
        self.rows = allocation.counts

    def workspace(self, samples: int) -> RowSpace:
        """Rows for the intermediate values of at most so many samples."""
        return tuple(aligned_rows(self.rows[kind], samples, dtype) for kind, dtype in DTYPES.items())

    def __call__(self, rows: Sequence[FloatArray], outputs: FloatArray, workspace: RowSpace) -> None:
        """Compute outputs, (outputs, samples), in place from rows of inputs, (samples,)."""
        samples = len(rows[0])
        with np.errstate(all="ignore"):
            self.run(rows, [values[:, :samples] for values in workspace], outputs)


class _RowAllocation:
    """Which row each value of a program lies in while it is live, as a compiler allocates registers.

    Attributes:
        counts: how many rows there are of each kind.
        constants: by their names, as arrays (): NumPy would make one of each number, at every call.
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
        """Statements that give the rows their names."""
        spaces = ("real", "truth", "bits")
        yield f" {', '.join(spaces)} = workspace"
        yield _unpacking("x", len(self._program.inputs), "inputs")
        yield _unpacking("o", len(self._program.outputs), "outputs")
        for space, (kind, letter) in zip(spaces, _LETTERS.items(), strict=True):
            yield _unpacking(letter, self.counts[kind], space)

    def statements(self) -> Iterator[str]:
        """Statements that compute."""
        yield from self._calls
        for number, output in enumerate(self._program.outputs):
            if not (isinstance(output, Symbol) and self._output_row.get(output.index) == f"o{number}"):
                yield f" o{number}[:] = {self._operand(output)}"

    def _operation(self, number: int) -> Iterator[str]:
        symbol = self._program.operations[number]
        if symbol.kind not in DTYPES or symbol.operation in _NONE_ON_ROWS:
            raise NotImplementedError(f"{symbol.operation} has no form on rows")
        operands = [self._operand(operand, symbol.kind) for operand in symbol.operands]
        if symbol.operation in _SELECTIONS:  # written in two steps, so no operand may lie in the same row
            row = self._allocated(symbol)
            one, other = _SELECTIONS[symbol.operation].format(*operands).split(", ")
            yield f" copyto({row}, {other})"
            yield f" copyto({row}, {one}, where={operands[0]})"
            self._free_dead_operands(symbol, number)
        else:
            self._free_dead_operands(symbol, number)
            out = "out=" if symbol.operation in CHOOSING else ""  # a keyword takes longer; these ask for it
            yield f" {symbol.operation}({', '.join(operands)}, {out}{self._allocated(symbol)})"

    def _operand(self, operand: Operand, kind: Kind = Kind.REAL) -> str:
        """A row, or a constant as values of a kind have it."""
        if isinstance(operand, Symbol):
            return self._row[operand.index]
        kind = _kind_of_constant(operand, kind)
        name = self._constant_names.setdefault((kind, repr(operand)), f"c{len(self._constant_names)}")
        self.constants[name] = np.array(operand, dtype=DTYPES[kind])
        return name

    def _allocated(self, symbol: Symbol) -> str:
        """A row for a value: that of an output, one that is free, or a new one."""
        row = self._output_row.get(symbol.index)
        if row is None and self._free[symbol.kind]:
            row = self._free[symbol.kind].pop()
        if row is None:
            row = f"{_LETTERS[symbol.kind]}{self.counts[symbol.kind]}"
            self.counts[symbol.kind] += 1
        self._row[symbol.index] = row
        return row

    def _free_dead_operands(self, symbol: Symbol, number: int) -> None:
        """The rows of operands that are not needed any more, and of no output, may be used again."""
        for operand in dict.fromkeys(part for part in symbol.operands if isinstance(part, Symbol)):
            dead = self._last_use[operand.index] == number and operand.index not in self._returned
            if dead and operand.operation != "input":
                self._free[operand.kind].append(self._row[operand.index])


def _kind_of_constant(constant: float | int | bool, wanted: Kind) -> Kind:
    """That of the operation, but for comparisons: they find truth values for numbers."""
    return wanted if wanted is Kind.BITS else kind_of(constant)


def _unpacking(letter: str, count: int, whole: str) -> str:
    return f" ({''.join(f'{letter}{number}, ' for number in range(count))}) = {whole}"
