"""C functions that keep code short: of subroutines, and of programs that consist of calls.

A subroutine is used in a few places, also in loops: its function receives its arguments by value. The body of
a call may have hundreds of operations and be called hundreds of times, each time on other values and with
other constants. So its function receives the workspace with all values, the constants of the call, and the
indices in the workspace of the values that it reads and writes.
"""

from __future__ import annotations

from array import array
from collections.abc import Hashable, Iterable, Iterator
from itertools import count
from typing import Any, NamedTuple

from vsacli.compute.tracing.c_code import Writer
from vsacli.compute.tracing.calls import Workspace, values_of
from vsacli.compute.tracing.program import NESTED, Kind, Program, SelectionTable, Subroutine, Symbol


class Subroutines:
    """All subroutines of some programs; equal ones share a function.

    Attributes:
        bodies: Bodies by the name of the function, each after those that it calls.
    """

    def __init__(self, programs: Iterable[Program] = ()) -> None:
        self._names: dict[Hashable, str] = {}
        self.bodies: dict[str, Program] = {}
        for program in programs:
            for body in _subroutine_bodies(program):
                name = self._names.setdefault(_program_key(body), f"subroutine_{len(self._names)}")
                self.bodies.setdefault(name, body)

    def name(self, body: Program) -> str:
        """Return the name of the function of a body."""
        return self._names[_program_key(body)]

    def functions(self, writer: Writer) -> Iterator[Iterator[str]]:
        """Yield the text of each function, with arguments by value and a pointer to its results."""
        real = writer.dialect.types[Kind.REAL]
        for name, body in self.bodies.items():
            names = {symbol.index: f"x{index}" for index, symbol in enumerate(body.inputs)}
            arguments = [f"{real} {argument}" for argument in names.values()]
            head = f"static void {name}({', '.join([*arguments, f'{real} *y'])})"
            yield writer.definition(head, body, names, "y")


def _subroutine_bodies(program: Program) -> Iterator[Program]:
    """Yield the bodies of subroutines, the inner ones first."""
    for symbol in program.operations:
        if symbol.operation in NESTED:
            nested = symbol.operands[0]
            yield from _subroutine_bodies(nested.body)
            if isinstance(nested, Subroutine):
                yield nested.body


def _program_key(program: Program) -> Hashable:
    """Return a key that is equal for programs with the same operations in the same order."""
    operations = tuple(
        (symbol.index, symbol.operation, symbol.kind, *map(_operand_key, symbol.operands))
        for symbol in program.operations
    )
    return tuple(map(_operand_key, program.inputs)), operations, tuple(map(_operand_key, program.outputs))


def _operand_key(operand: Any) -> Hashable:
    """Return a value by its number, a constant by its digits, so that NaN equals itself."""
    if isinstance(operand, Symbol):
        return operand.index, operand.kind
    if isinstance(operand, SelectionTable):
        return array("d", operand.values).tobytes()
    if isinstance(operand, tuple):  # a loop, branch, call or subroutine
        body, *attributes = operand
        return type(operand), _program_key(body), repr(attributes)
    return repr(operand)


VALUES, CONSTANTS, PLACES = "values", "constants", "places"
"""Names of a function's parameters: workspace, constants, and places of arguments and results."""


class _Function(NamedTuple):
    """A function for the body of calls, and the arguments that are constants."""

    name: str
    body: Program
    constant: tuple[bool, ...]


class CallingCode:
    """The parts of C code for a program of calls.

    Args:
        name: Beginning of the names of functions and tables.
        program: Program that consists of calls and their items.
        writer: Writer of the bodies.

    Attributes:
        slots: Number of values in the workspace.
        slot: Places of inputs and outputs in the workspace, by index; those of inputs in order, from 0 on.
    """

    def __init__(self, name: str, program: Program, writer: Writer) -> None:
        self._name = name
        self._writer = writer
        self._dialect = writer.dialect
        self._constant_type = self._dialect.array_type((), True)
        self._functions: dict[int, _Function] = {}
        self._constants: list[float] = []
        self._slot_table: list[int] = []
        self._statements: list[str] = []
        workspace = Workspace(program)
        for symbol in program.operations:
            if symbol.operation == "call":
                self._add_call(symbol, [*values_of(symbol), *workspace.results(symbol)], workspace)
        self.slot, self.slot_count = workspace.slot, workspace.counts[Kind.REAL]

    def declarations(self, qualifiers: str) -> Iterator[str]:
        """Return the tables, and the functions with these qualifiers."""
        constants = (
            ", ".join(self._dialect.entry(value, self._constant_type) for value in self._constants) or "0"
        )
        yield f"static const {self._constant_type} {self._name}_{CONSTANTS}[] = {{{constants}}};"
        yield f"static const int {self._name}_{PLACES}[] = {{{', '.join(map(str, self._slot_table))}}};"
        for function in self._functions.values():
            yield from self._function_definition(function, qualifiers)

    def statements(self) -> Iterator[str]:
        """Yield the statements that compute the outputs in the workspace from the inputs there."""
        return iter(self._statements)

    def value(self, symbol: Symbol, index: str | int) -> str:
        """Return a value in the workspace."""
        return self._dialect.from_slot(symbol.kind, f"{VALUES}[{index}]")

    def _add_call(self, symbol: Symbol, slot_values: list[Symbol], workspace: Workspace) -> None:
        (body, _), *operands = symbol.operands
        constant = tuple(not isinstance(operand, Symbol) for operand in operands)
        new_function = _Function(f"{self._name}_{len(self._functions)}", body, constant)
        function = self._functions.setdefault(id(body), new_function)
        constants = f"{self._name}_{CONSTANTS} + {len(self._constants)}"
        self._statements.append(
            f"{function.name}({VALUES}, {constants}, {self._name}_{PLACES} + {len(self._slot_table)});"
        )
        self._constants += [float(operand) for operand in operands if not isinstance(operand, Symbol)]
        self._slot_table += [workspace.slot[value.index] for value in slot_values]

    def _function_definition(self, function: _Function, qualifiers: str) -> Iterator[str]:
        """Yield a function that loads inputs at first use and stores results at once, to save registers."""
        types, body = self._dialect.types, function.body
        values, table = f"{types[Kind.REAL]} *{VALUES}", f"const {self._constant_type} *{CONSTANTS}"
        yield f"{qualifiers} void {function.name}({values}, {table}, const int *{PLACES})"
        yield "{"
        if not any(function.constant):
            yield f"(void){CONSTANTS};"
        sources, names = self._input_sources(function), dict[int, str]()
        results = (output.index for output in body.outputs if isinstance(output, Symbol))
        result_indices = dict(zip(results, count(function.constant.count(False)), strict=False))
        for symbol in body.operations:
            for operand in values_of(symbol):
                if operand.index in sources and operand.index not in names:
                    names[operand.index] = f"x{operand.index}"
                    yield f"const {types[operand.kind]} x{operand.index} = {sources[operand.index]};"
            yield from self._writer.statements([symbol], names)
            if symbol.index in result_indices:
                stored_value = self._dialect.to_slot(
                    symbol.kind, self._writer.value(symbol, symbol.kind, names)
                )
                yield f"{VALUES}[{PLACES}[{result_indices[symbol.index]}]] = {stored_value};"
        yield "}"

    def _input_sources(self, function: _Function) -> dict[int, str]:
        """Return the sources of the inputs of a body."""
        sources, value_count, constant_count = {}, 0, 0
        for symbol, is_constant in zip(function.body.inputs, function.constant, strict=True):
            if is_constant:
                sources[symbol.index] = self._dialect.write("spread", f"{CONSTANTS}[{constant_count}]")
                constant_count += 1
            else:
                sources[symbol.index] = self.value(symbol, f"{PLACES}[{value_count}]")
                value_count += 1
        return sources
