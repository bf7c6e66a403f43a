"""Subroutines of programs, each of which stands in C once, wherever it is computed."""

from __future__ import annotations

from array import array
from collections.abc import Hashable, Iterable, Iterator
from typing import Any

from vsacli.compute.tracing.program import NESTED, Program, Subroutine, Symbol, Table


class Subroutines:
    """All subroutines of some programs; those that do the same are one.

    Attributes:
        bodies: by the name of the function, after those that it needs.
    """

    def __init__(self, programs: Iterable[Program] = ()) -> None:
        self._names: dict[Hashable, str] = {}
        self.bodies: dict[str, Program] = {}
        for program in programs:
            for body in _bodies(program):
                name = self._names.setdefault(_key(body), f"subroutine_{len(self._names)}")
                self.bodies.setdefault(name, body)

    def name(self, body: Program) -> str:
        """The function that does what a body does."""
        return self._names[_key(body)]


def _bodies(program: Program) -> Iterator[Program]:
    """Those of subroutines, the inner ones first."""
    for symbol in program.operations:
        if symbol.operation in NESTED:
            nested = symbol.operands[0]
            yield from _bodies(nested.body)
            if isinstance(nested, Subroutine):
                yield nested.body


def _key(program: Program) -> Hashable:
    """What is the same of programs that do the same in the same order."""
    operations = tuple(
        (symbol.index, symbol.operation, symbol.kind, *map(_part, symbol.operands))
        for symbol in program.operations
    )
    return tuple(map(_part, program.inputs)), operations, tuple(map(_part, program.outputs))


def _part(operand: Any) -> Hashable:
    """A value by its number, a constant by its digits; NaN, too, equals itself."""
    if isinstance(operand, Symbol):
        return operand.index, operand.kind
    if isinstance(operand, Table):
        return array("d", operand.values).tobytes()
    if isinstance(operand, tuple):  # what holds a program
        body, *rest = operand
        return type(operand), _key(body), repr(rest)
    return repr(operand)
