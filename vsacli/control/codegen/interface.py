"""Inputs and outputs of a generated function, declared once for header, source and self-test."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from vsacli.compute.rows import RowLayout
from vsacli.compute.tracing import Kind, Program, Tape, TracedArray, cells_of, trace_by_size

Rows = Sequence[Any]

MOST_WRITTEN_OUT = 20_000
"""Largest number of operations of a function without calls: gcc compiles it in 8 s."""

MOST_OF_CALLS = 50_000
"""Largest number of calls, their results and operations between them: gcc takes a minute at most."""


@dataclass(frozen=True)
class Array:
    """An array of a structure.

    Attributes:
        name: name in C.
        shape: shape of the array.
        meaning: short description with the unit.
        bits: whether entries are bit fields; numbers otherwise.
    """

    name: str
    shape: tuple[int, ...]
    meaning: str
    bits: bool = False

    @property
    def entries(self) -> Iterator[str]:
        """Yield the entries as written in C, e.g. `theta[0][1]`."""
        for index in product(*map(range, self.shape)):
            yield self.name + "".join(f"[{axis_index}]" for axis_index in index)


@dataclass(frozen=True)
class Structure:
    """A struct of arrays.

    Attributes:
        name: name in C, without the robot's prefix.
        meaning: short description.
        arrays: members.
        nominal: nominal values of the entries, written as a constant; empty for none.
        by_value: whether the only entry is itself the argument, so that there is no such struct in C.
    """

    name: str
    meaning: str
    arrays: tuple[Array, ...]
    nominal: tuple[float, ...] = ()
    by_value: bool = False

    @property
    def entries(self) -> Iterator[str]:
        """Yield the entries of all arrays as written in C."""
        return (entry for array in self.arrays for entry in array.entries)

    @property
    def layout(self) -> RowLayout:
        """Layout of the entries of each array among all entries."""
        return RowLayout({array.name: array.shape for array in self.arrays})


Arguments = tuple[tuple[str, Structure], ...]
"""Names and structures of the arguments of a function."""


def rows_by_argument(arguments: Arguments, rows: Rows) -> dict[str, Rows]:
    """Return the rows of each argument."""
    return RowLayout({name: (structure.layout.size,) for name, structure in arguments}).unpack(rows)


def arrays_by_argument(arguments: Arguments, rows: Rows) -> dict[str, dict[str, Any]]:
    """Return the arrays of each argument for one sample, by their names."""
    entries = rows_by_argument(arguments, rows)
    return {name: structure.layout.arrays(np.concatenate(entries[name])) for name, structure in arguments}


def rows_by_array(arguments: Arguments, rows: Rows) -> dict[str, Rows]:
    """Return the rows of all arguments by array name; names must differ between arguments."""
    return RowLayout(
        {array.name: array.shape for _, structure in arguments for array in structure.arrays}
    ).unpack(rows)


def structures(functions: Sequence[Function]) -> list[Structure]:
    """Return the structures that functions use in C, without duplicates."""
    used_structures = (
        structure
        for function in functions
        for structure in (*dict(function.arguments).values(), function.result)
    )
    return [structure for structure in dict.fromkeys(used_structures) if not structure.by_value]


@dataclass(frozen=True)
class Function:
    """A function to generate.

    Attributes:
        name: name in C, without the robot's prefix.
        meaning: description for the header.
        arguments: names and structures of the arguments.
        result: structure that the function fills.
        compute: function from rows of all entries of the arguments to rows of the entries of the result. The
            C function returns the bits of the result, combined over all joints.
        result_name: name of the result as an argument in C; that of its structure if empty.
    """

    name: str
    meaning: str
    arguments: Arguments
    result: Structure
    compute: Callable[[Rows], Rows]
    result_name: str = ""

    @property
    def output(self) -> str:
        """Name of the result as an argument in C."""
        return self.result_name or self.result.name

    @property
    def inputs(self) -> list[str]:
        """Entries of all arguments as written in C."""
        return [
            name if structure.by_value else f"{name}->{entry}"
            for name, structure in self.arguments
            for entry in structure.entries
        ]

    @cached_property
    def program(self) -> Program:
        """Program of the function for one sample.

        Raises:
            NotImplementedError: no program with a bounded number of operations exists, or it is too long.
        """
        kinds = [Kind.REAL] * sum(structure.layout.size for _, structure in self.arguments)
        try:
            return trace_by_size(self.compute, kinds, MOST_WRITTEN_OUT, MOST_OF_CALLS, short=True)
        except NotImplementedError as error:
            raise NotImplementedError(f"{self.name}: {error}") from error


Evaluate = Callable[[Rows], Rows]
"""Function from rows of the arguments of a generated function to rows of its result."""


@dataclass(frozen=True, kw_only=True)
class Step(Function):
    """A step of an integrator, whose C code calls the function of the derivative.

    Attributes:
        derivative: function of the time derivative of the state.
        advance: `compute` with the evaluation of the derivative as a further argument, the first.
    """

    derivative: Function
    advance: Callable[[Evaluate, Rows], Rows]

    @cached_property
    def program(self) -> Program:
        """Program of a step, in which the derivative is a subroutine."""
        tape, body = Tape(), self.derivative.program

        def evaluate(rows: Rows) -> Rows:
            results = tape.emit_subroutine(body, [cells_of(row).item() for row in rows])
            return [TracedArray(tape, [result]) for result in results]

        rows = [TracedArray(tape, [symbol]) for symbol in tape.inputs(len(self.inputs))]
        return tape.program([cells_of(row).item() for row in self.advance(evaluate, rows)])
