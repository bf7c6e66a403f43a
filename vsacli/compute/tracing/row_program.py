"""Recorded programs on long rows of samples: one call of NumPy an operation, results in rows used again.

The text that was recorded makes a new row for each intermediate value, and computes some of them twice. This
does neither, so that what it works on stays in the processor's cache; it finds the same numbers to the last
bit.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from types import CodeType, FunctionType
from typing import Any

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import FloatArray
from vsacli.compute.tracing.dead_code import Listing
from vsacli.compute.tracing.symbol import Kind, Operand, Symbol

Scratch = tuple[npt.NDArray[Any], ...]
"""Rows of real numbers, truth values, and bits."""

_DTYPES: dict[Kind, type[np.generic]] = {Kind.REAL: np.float64, Kind.TRUTH: np.bool_, Kind.BITS: np.uint16}
_LETTERS = {Kind.REAL: "r", Kind.TRUTH: "t", Kind.BITS: "b"}
_CHOOSING = {"where": "{1}, {2}", "bits": "{1}, 0"}


class RowProgram:
    """A recorded computation without loops and tables, over rows of any length.

    Attributes:
        rows: how many intermediate values of each kind are kept at most at a time.

    Raises:
        NotImplementedError: it has loops, branches or tables.
    """

    def __init__(self, listing: Listing) -> None:
        kept = _Rows(listing)
        source = "\n".join(["def program(inputs, scratch, outputs):", *kept.heading(), *kept.lines()])
        module = compile(source, "<recorded program>", "exec")
        code = next(constant for constant in module.co_consts if isinstance(constant, CodeType))
        self._run: Callable[..., None] = FunctionType(code, {**vars(np), "nan": np.nan, "inf": np.inf})
        self.rows = kept.counts

    def scratch(self, samples: int) -> Scratch:
        """Rows for the intermediate values of at most so many samples."""
        return tuple(np.empty((self.rows[kind], samples), dtype) for kind, dtype in _DTYPES.items())

    def __call__(self, rows: Sequence[FloatArray], outputs: FloatArray, scratch: Scratch) -> None:
        """Compute outputs, (outputs, samples), in place from rows of inputs, (samples,)."""
        samples = len(rows[0])
        with np.errstate(all="ignore"):
            self._run(rows, [values[:, :samples] for values in scratch], outputs)


class _Rows:
    """Which row each value of a program is kept in, as long as it is needed."""

    def __init__(self, listing: Listing) -> None:
        self._listing = listing
        self.counts: dict[Kind, int] = defaultdict(int)
        self._free: dict[Kind, list[str]] = defaultdict(list)
        self._name = {symbol.index: f"x{number}" for number, symbol in enumerate(listing.inputs)}
        self._last = {
            operand.index: number
            for number, symbol in enumerate(listing.operations)
            for operand in symbol.operands
            if isinstance(operand, Symbol)
        }
        self._output: dict[int, str] = {}
        for number, output in enumerate(listing.outputs):
            if isinstance(output, Symbol) and output.kind is Kind.REAL and output.operation != "input":
                self._output.setdefault(output.index, f"o{number}")
        self._operations = [
            line for number in range(len(listing.operations)) for line in self._operation(number)
        ]

    def heading(self) -> Iterator[str]:
        """Statements that give the rows their names."""
        spaces = ("real", "truth", "bits")
        yield f" {', '.join(spaces)} = scratch"
        yield _unpacking("x", len(self._listing.inputs), "inputs")
        yield _unpacking("o", len(self._listing.outputs), "outputs")
        for space, (kind, letter) in zip(spaces, _LETTERS.items(), strict=True):
            yield _unpacking(letter, self.counts[kind], space)

    def lines(self) -> Iterator[str]:
        """Statements that compute."""
        yield from self._operations
        for number, output in enumerate(self._listing.outputs):
            if not (isinstance(output, Symbol) and self._output.get(output.index) == f"o{number}"):
                yield f" outputs[{number}] = {self._operand(output)}"

    def _operation(self, number: int) -> Iterator[str]:
        symbol = self._listing.operations[number]
        if symbol.kind not in _DTYPES or symbol.operation in {"item", "take"}:
            raise NotImplementedError(f"{symbol.operation} has no form on rows")
        operands = [self._operand(operand, symbol.kind) for operand in symbol.operands]
        if symbol.operation in _CHOOSING:  # written in two steps, so that no operand may lie in the same row
            row = self._taken(symbol)
            one, other = _CHOOSING[symbol.operation].format(*operands).split(", ")
            yield f" copyto({row}, {other})"
            yield f" copyto({row}, {one}, where={operands[0]})"
            self._release(symbol, number)
        else:
            self._release(symbol, number)
            yield f" {symbol.operation}({', '.join(operands)}, out={self._taken(symbol)})"

    def _operand(self, operand: Operand, kind: Kind = Kind.REAL) -> str:
        """A row, or a constant as values of a kind have it."""
        if isinstance(operand, Symbol):
            return self._name[operand.index]
        return repr(int(operand) if kind is Kind.BITS else operand)

    def _taken(self, symbol: Symbol) -> str:
        """A row for a value, from now on its name."""
        row = self._output.get(symbol.index)
        if row is None and self._free[symbol.kind]:
            row = self._free[symbol.kind].pop()
        if row is None:
            row = f"{_LETTERS[symbol.kind]}{self.counts[symbol.kind]}"
            self.counts[symbol.kind] += 1
        self._name[symbol.index] = row
        return row

    def _release(self, symbol: Symbol, number: int) -> None:
        """The rows of operands that are not needed any more, and of no output, may be used again."""
        kept = {output.index for output in self._listing.outputs if isinstance(output, Symbol)}
        for operand in dict.fromkeys(part for part in symbol.operands if isinstance(part, Symbol)):
            done = self._last[operand.index] == number and operand.index not in kept
            if done and operand.operation != "input":
                self._free[operand.kind].append(self._name[operand.index])


def _unpacking(letter: str, count: int, whole: str) -> str:
    return f" ({''.join(f'{letter}{number}, ' for number in range(count))}) = {whole}"
