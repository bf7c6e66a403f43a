"""Inputs and outputs of a generated function, declared once for header, source and self-test."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

from vsacli.compute.rows import RowLayout
from vsacli.compute.tracing import Kind, Program, trace_by_size

Rows = Sequence[Any]

MOST_WRITTEN_OUT = 20_000
"""Operations of the longest functions that call no others: gcc takes 8 s for it."""

MOST_OF_CALLS = 50_000
"""Calls, their results, and operations between them, of the other functions: gcc takes a minute at most."""


@dataclass(frozen=True)
class Array:
    """An array of a structure.

    Attributes:
        name: as in C.
        shape: of the array.
        meaning: a few words, with its unit.
        bits: whether the entries are fields of bits, else numbers.
    """

    name: str
    shape: tuple[int, ...]
    meaning: str
    bits: bool = False

    @property
    def entries(self) -> Iterator[str]:
        """Yield the entries as written in C, e.g. `theta[0][1]`."""
        for index in product(*map(range, self.shape)):
            yield self.name + "".join(f"[{number}]" for number in index)


@dataclass(frozen=True)
class Structure:
    """A struct of arrays.

    Attributes:
        name: as in C, without the prefix of the robot.
        meaning: a few words.
        arrays: its members.
        nominal: values of its entries, of which a constant is made; empty if there are none.
    """

    name: str
    meaning: str
    arrays: tuple[Array, ...]
    nominal: tuple[float, ...] = ()

    @property
    def entries(self) -> Iterator[str]:
        """Yield the entries of all arrays as written in C."""
        return (entry for array in self.arrays for entry in array.entries)

    @property
    def layout(self) -> RowLayout:
        """Places of the entries of each array among all entries."""
        return RowLayout({array.name: array.shape for array in self.arrays})


Arguments = tuple[tuple[str, Structure], ...]
"""Structures that a function reads, by the names of the arguments."""


def unpacked(arguments: Arguments, rows: Rows) -> dict[str, Rows]:
    """Rows of all entries of the arguments by the names of their arrays, which differ."""
    return RowLayout({array.name: array.shape for _, each in arguments for array in each.arrays}).unpack(rows)


def structures(functions: Sequence[Function]) -> list[Structure]:
    """Return each structure that functions use, once."""
    used = (each for function in functions for each in (*dict(function.arguments).values(), function.result))
    return list(dict.fromkeys(used))


@dataclass(frozen=True)
class Function:
    """A function to generate.

    Attributes:
        name: as in C, without the prefix of the robot.
        meaning: for the header.
        arguments: structures that it reads, by the names of the arguments.
        result: structure that it fills.
        compute: from rows of samples of all entries of the arguments to rows of the entries of the result,
            whose bits, of all joints together, the function returns.
    """

    name: str
    meaning: str
    arguments: Arguments
    result: Structure
    compute: Callable[[Rows], Rows]

    @cached_property
    def program(self) -> Program:
        """Return the program of the function for one sample.

        Raises:
            NotImplementedError: it has no evaluation in a bounded number of operations, or one of too many.
        """
        kinds = [Kind.REAL] * sum(structure.layout.size for _, structure in self.arguments)
        try:
            return trace_by_size(self.compute, kinds, MOST_WRITTEN_OUT, MOST_OF_CALLS, short=True)
        except NotImplementedError as error:
            raise NotImplementedError(f"{self.name}: {error}") from error
