"""Programs as statements of C, in a dialect for single samples or one for vectors of them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from vsacli.compute.tracing.c_subroutines import Subroutines
from vsacli.compute.tracing.c_tables import Place, Tables
from vsacli.compute.tracing.program import (
    BITWISE,
    LOGICAL,
    Branch,
    Kind,
    Loop,
    Operand,
    Program,
    Symbol,
    Table,
    kind_of,
    kinds_of_operands,
)

INFIX = {
    "add": "+",
    "subtract": "-",
    "multiply": "*",
    "divide": "/",
    "less": "<",
    "less_equal": "<=",
    "greater": ">",
    "greater_equal": ">=",
    "equal": "==",
    "not_equal": "!=",
    "bitwise_and": "&",
    "bitwise_or": "|",
}

C_NAMES = {
    "absolute": "fabs",
    "power": "pow",
    "searchsorted": "search",
    **{f"arc{name}": f"a{name}" for name in ("sin", "cos", "tan", "tan2", "sinh")},
}
"""Functions that have another name than in NumPy."""

Names = Mapping[int, str]
"""What inputs of a program are called, by index."""


class Dialect(ABC):
    """How values and operations are written.

    Attributes:
        types: C type of each kind of value.
    """

    def __init__(self, types: Mapping[Kind, str]) -> None:
        self.types = types

    @abstractmethod
    def real(self, number: float) -> str:
        """A constant."""

    @abstractmethod
    def array_type(self, values: tuple[float, ...], searched: bool) -> str:
        """Type of the constants in an array, and whether a search goes through them."""

    @abstractmethod
    def entry(self, number: float, array_type: str) -> str:
        """A constant in an array of a type."""

    @abstractmethod
    def take(self, place: Place, index: str) -> str:
        """The entry of a table at an index."""

    @abstractmethod
    def integer(self, number: int) -> str:
        """A constant field of bits or index."""

    @abstractmethod
    def truth(self, value: bool) -> str:
        """A constant truth value."""

    @abstractmethod
    def logical(self, operator: str, operands: Sequence[str]) -> str:
        """`and`, `or`, `not` of truth values."""

    @abstractmethod
    def where(self, kind: Kind, truth: str, a: str, b: str) -> str:
        """One of two values of a kind."""

    @abstractmethod
    def masked(self, truth: str, mask: str) -> str:
        """The mask where true, else 0."""

    @abstractmethod
    def function(self, kind: Kind, name: str, operands: Sequence[str]) -> str:
        """A call that gives a value of a kind.

        The name is one of math.h; or `maximum`, `minimum`, which NaN passes through; or `search` in a table,
        which are a pointer and a number of entries.
        """

    @abstractmethod
    def any(self, truth: str) -> str:
        """Whether a truth value holds for any sample, as a condition of C."""

    @abstractmethod
    def replaced(self, kind: Kind, truth: str, new: str, old: str) -> str:
        """The new value, for samples for which a truth value holds, in a place where it does for one."""

    @abstractmethod
    def from_slot(self, kind: Kind, slot: str) -> str:
        """The value of a kind that lies in a place for real ones."""

    @abstractmethod
    def to_slot(self, kind: Kind, value: str) -> str:
        """A value of a kind as it lies in a place for real ones."""

    @abstractmethod
    def from_table(self, entry: str) -> str:
        """A real value from a table of constants."""

    def constant(self, value: float | int | bool, kind: Kind) -> str:
        """A constant of a kind."""
        if kind is Kind.TRUTH:
            return self.truth(bool(value))
        return self.real(float(value)) if kind is Kind.REAL else self.integer(int(value))


def digits(number: float) -> str:
    """A constant with all its digits; those that are not finite by their names of math.h."""
    if math.isnan(number):
        return "NAN"
    if math.isinf(number):
        return "INFINITY" if number > 0 else "(-INFINITY)"
    return f"({number!r})" if number < 0 else repr(number)


class Writer:
    """Writes programs in a dialect.

    Args:
        dialect: how to write.
        tables: where their constants are.
        subroutines: which there are.
    """

    def __init__(self, dialect: Dialect, tables: Tables, subroutines: Subroutines | None = None) -> None:
        self._dialect = dialect
        self._tables = tables
        self._subroutines = subroutines or Subroutines()

    def statements(self, operations: Iterable[Symbol], names: Names, prefix: str = "v") -> Iterator[str]:
        """Declarations of the values of operations, in their order; names of values begin with the prefix."""
        for symbol in operations:
            if symbol.operation == "subroutine":
                yield from self._subroutine(symbol, names, prefix)
            elif symbol.operation in {"loop", "branch"}:
                yield from self._nested(symbol, names, prefix)
            elif symbol.operation != "item":
                text = self._expression(symbol, names, prefix)
                yield f"const {self._dialect.types[symbol.kind]} {_name(symbol, names, prefix)} = {text};"

    def value(self, operand: Operand, kind: Kind, names: Names, prefix: str = "v") -> str:
        """A value, or a constant of that kind."""
        if isinstance(operand, Symbol):
            return _name(operand, names, prefix)
        return self._dialect.constant(operand, kind)

    def _expression(self, symbol: Symbol, names: Names, prefix: str) -> str:
        operation, dialect = symbol.operation, self._dialect
        if isinstance(table := symbol.operands[0], Table):
            return self._from_table(table, symbol, names, prefix)
        texts = [
            self.value(operand, kind, names, prefix)
            for operand, kind in zip(symbol.operands, kinds_of_operands(symbol), strict=True)
        ]
        if operation in INFIX and not (operation in BITWISE and symbol.kind is Kind.TRUTH):
            return f"{texts[0]} {INFIX[operation]} {texts[1]}"
        if operation == "negative":
            return f"-{texts[0]}"
        if operation == "isnan":
            return f"{texts[0]} != {texts[0]}"
        if operation == "where":
            return dialect.where(symbol.kind, *texts)
        if operation == "bits":
            return dialect.masked(*texts)
        if operation in LOGICAL:
            return dialect.logical(LOGICAL[operation], texts)
        return dialect.function(symbol.kind, C_NAMES.get(operation, operation), texts)

    def function(self, body: Program) -> Iterator[str]:
        """The function of a subroutine: its arguments, and where it puts its results."""
        real = self._dialect.types[Kind.REAL]
        names = {symbol.index: f"x{number}" for number, symbol in enumerate(body.inputs)}
        arguments = [f"{real} {name}" for name in names.values()]
        head = f"static void {self._subroutines.name(body)}({', '.join([*arguments, f'{real} *y'])})"
        yield from self.definition(head, body, names, "y")

    def definition(self, head: str, program: Program, names: Names, results: str) -> Iterator[str]:
        """A function that puts what a program computes into an array of real numbers."""
        yield head
        yield "{"
        yield from self.statements(program.operations, names)
        for number, output in enumerate(program.outputs):
            yield f"{results}[{number}] = {self.value(output, Kind.REAL, names)};"
        yield "}"

    def _subroutine(self, symbol: Symbol, names: Names, prefix: str) -> Iterator[str]:
        """An array of the results, and what fills it."""
        (body,), *operands = symbol.operands
        own = _name(symbol, names, prefix)
        arguments = [self.value(operand, Kind.REAL, names, prefix) for operand in operands]
        yield f"{self._dialect.types[Kind.REAL]} {own}[{len(body.outputs)}];"
        yield f"{self._subroutines.name(body)}({', '.join([*arguments, own])});"

    def _from_table(self, table: Table, symbol: Symbol, names: Names, prefix: str) -> str:
        place, taken = self._tables.place(table), symbol.operation == "take"
        operand = self.value(symbol.operands[1], Kind.INDEX if taken else Kind.REAL, names, prefix)
        if taken:
            return self._dialect.take(place, operand)
        searched = (place.pointer, str(len(table.values)), operand)
        return self._dialect.function(Kind.INDEX, C_NAMES[symbol.operation], searched)

    def _nested(self, symbol: Symbol, names: Names, prefix: str) -> Iterator[str]:
        """A loop or branch: variables of its results, and the block that computes them."""
        nested, *operands = symbol.operands
        own = _name(symbol, names, prefix)
        if isinstance(nested, Loop):
            yield from self._loop(nested, own, operands, names, prefix)
        else:
            yield from self._branch(nested, own, operands, names, prefix)

    def _loop(self, loop: Loop, own: str, operands: list[Any], names: Names, prefix: str) -> Iterator[str]:
        body, dialect = loop.body, self._dialect
        state = [f"{own}_{number}" for number in loop.numbers]
        kinds = [symbol.kind for symbol in body.inputs]
        given = [
            self.value(operand, kind, names, prefix) for operand, kind in zip(operands, kinds, strict=True)
        ]
        going = f"{own}_going"
        yield f"{dialect.types[Kind.TRUTH]} {going} = {dialect.truth(True)};"
        yield from self._variables(state, given, kinds)
        yield f"for (int {own}_step = 0; {own}_step < {loop.limit} && {dialect.any(going)}; {own}_step++) {{"
        inner = _renamed(body, [*state, *given[len(state) :]])
        yield from self._body(body, own, inner, state, going)
        done = self.value(body.outputs[-1], Kind.TRUTH, inner, f"{own}_v")
        ongoing = dialect.logical("not", [done])
        yield f"{going} = {dialect.logical('and', [going, f'({ongoing})'])};"
        yield "}"

    def _branch(
        self, branch: Branch, own: str, operands: list[Any], names: Names, prefix: str
    ) -> Iterator[str]:
        body, dialect = branch.body, self._dialect
        count = len(body.outputs)
        truth, otherwise, arguments = operands[0], operands[1 : 1 + count], operands[1 + count :]
        results = [f"{own}_{number}" for number in branch.numbers]
        kinds = [kind_of(output) for output in body.outputs]
        given = [
            self.value(operand, kind, names, prefix) for operand, kind in zip(otherwise, kinds, strict=True)
        ]
        yield from self._variables(results, given, kinds)
        where = self.value(truth, Kind.TRUTH, names, prefix)
        yield f"if ({dialect.any(where)}) {{"
        texts = [
            self.value(operand, symbol.kind, names, prefix)
            for operand, symbol in zip(arguments, body.inputs, strict=True)
        ]
        yield from self._body(body, own, _renamed(body, texts), results, where)
        yield "}"

    def _variables(self, names: list[str], values: list[str], kinds: list[Kind]) -> Iterator[str]:
        for name, value, kind in zip(names, values, kinds, strict=False):
            yield f"{self._dialect.types[kind]} {name} = {value};"

    def _body(self, body: Program, own: str, names: Names, results: list[str], where: str) -> Iterator[str]:
        """Statements of a body, and its outputs put into variables all at once."""
        prefix = f"{own}_v"
        yield from self.statements(body.operations, names, prefix)
        kinds = [kind_of(output) for output in body.outputs]
        for result, output, kind in zip(results, body.outputs, kinds, strict=False):
            value = self.value(output, kind, names, prefix)
            yield f"const {self._dialect.types[kind]} {result}_new = {value};"
        for result, kind in zip(results, kinds, strict=False):
            yield f"{result} = {self._dialect.replaced(kind, where, f'{result}_new', result)};"


def table_declarations(tables: Tables, dialect: Dialect) -> Iterator[str]:
    """Constants at the head of a file."""
    for name, array_type, values in tables.arrays:
        entries = ", ".join(dialect.entry(value, array_type) for value in values)
        yield f"static const {array_type} {name}[{len(values)}] = {{{entries}}};"


def _name(symbol: Symbol, names: Names, prefix: str) -> str:
    if symbol.operation == "item" and symbol.index not in names:
        nested, number = symbol.operands
        own = _name(nested, names, prefix)
        return f"{own}[{number}]" if nested.operation == "subroutine" else f"{own}_{number}"
    return names.get(symbol.index, f"{prefix}{symbol.index}")


def _renamed(body: Program, texts: list[str]) -> Names:
    """The inputs of a body by what they are given."""
    return {symbol.index: text for symbol, text in zip(body.inputs, texts, strict=True)}
