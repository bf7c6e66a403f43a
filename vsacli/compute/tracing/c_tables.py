"""The tables of programs as arrays of C: a table that is a part of another, or its equal, takes no memory."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from vsacli.compute.tracing.program import Branch, Call, Loop, Program, Subroutine, Table


class ConstantArray(NamedTuple):
    """An array of constants.

    Attributes:
        name: as in C.
        type: of its entries, as in C.
        values: its entries.
    """

    name: str
    type: str
    values: tuple[float, ...]


class Place(NamedTuple):
    """Where a table is."""

    array: ConstantArray
    offset: int

    @property
    def pointer(self) -> str:
        """Its first entry, as an expression of C."""
        return f"{self.array.name} + {self.offset}" if self.offset else self.array.name


ArrayType = Callable[[tuple[float, ...], bool], str]
"""Type in C of an array with some values, and whether they are searched."""


class Tables:
    """All tables of some programs.

    Args:
        programs: whose tables they are.
        array_type: of the entries of each array.

    Attributes:
        arrays: in which they lie, the longest first.
    """

    def __init__(self, programs: Iterable[Program], array_type: ArrayType) -> None:
        uses = list(table_uses(*programs))
        distinct = dict.fromkeys(table for table, _ in uses)
        contents: list[tuple[float, ...]] = []
        self._places = {
            table: _part(contents, table.values)
            for table in sorted(distinct, key=lambda table: -len(table.values))
        }
        searched = {self._places[table][0] for table, operation in uses if operation == "searchsorted"}
        self.arrays = [
            ConstantArray(f"table_{number}", array_type(values, number in searched), values)
            for number, values in enumerate(contents)
        ]

    def place(self, table: Table) -> Place:
        """Where a table is."""
        number, offset = self._places[table]
        return Place(self.arrays[number], offset)


def _part(contents: list[tuple[float, ...]], values: tuple[float, ...]) -> tuple[int, int]:
    """Number of the array in which values follow each other, bit for bit, or of a new one, and where."""
    wanted = array("d", values)
    for number, others in enumerate(contents):
        whole, at = array("d", others).tobytes(), -1
        while (at := whole.find(wanted.tobytes(), at + 1)) >= 0:
            if at % wanted.itemsize == 0:
                return number, at // wanted.itemsize
    contents.append(values)
    return len(contents) - 1, 0


def table_uses(*programs: Program) -> Iterator[tuple[Table, str]]:
    """Tables with the operations on them, in bodies also, of which each is looked at once."""
    seen: set[int] = set()
    for program in programs:
        yield from _uses(program, seen)


def _uses(program: Program, seen: set[int]) -> Iterator[tuple[Table, str]]:
    if id(program) in seen:
        return
    seen.add(id(program))
    for symbol in program.operations:
        for operand in symbol.operands:
            if isinstance(operand, Table):
                yield operand, symbol.operation
            elif isinstance(operand, Loop | Branch | Call | Subroutine):
                yield from _uses(operand.body, seen)
