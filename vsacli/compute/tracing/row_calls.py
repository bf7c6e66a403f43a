"""Programs of calls for rows of samples: each body is a function, on rows that are used again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import FloatArray
from vsacli.compute.aligned_rows import aligned_rows
from vsacli.compute.tracing.program import Kind, Operand, Program, Symbol
from vsacli.compute.tracing.python_code import DTYPES, RowFunction, RowSpace
from vsacli.compute.tracing.workspace import Workspace


class _Row(NamedTuple):
    """The place of a row among those of its kind; inputs come first."""

    kind: Kind
    place: int


_Source = _Row | npt.NDArray[Any]
"""A row, or a constant as an array ()."""


class _Call(NamedTuple):
    """A call of a function: what it is given, and where its results go."""

    function: RowFunction
    given: list[_Source]
    results: list[_Row]


class CallingRowFunction:
    """A program of calls on rows of any length; elsewise as `RowFunction`.

    Raises:
        NotImplementedError: the program has loops, branches or tables.
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
        """Rows for what calls hand on, and then for the intermediate values of any of the functions."""
        own = {
            kind: max((function.rows[kind] for function in self._functions.values()), default=0)
            for kind in DTYPES
        }
        return tuple(
            aligned_rows(self._kept[kind] + own[kind], samples, dtype) for kind, dtype in DTYPES.items()
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
    return values[source.kind][source.place] if isinstance(source, _Row) else source


def _source(operand: Operand, places: Workspace) -> _Source:
    if isinstance(operand, Symbol):
        return _row(operand, places)
    return np.array(operand, dtype=np.float64)


def _row(symbol: Symbol, places: Workspace) -> _Row:
    return _Row(symbol.kind, places.slot[symbol.index])
