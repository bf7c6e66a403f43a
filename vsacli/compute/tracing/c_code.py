"""Programs as statements of C.

A `Writer` writes the operations of a program one after the other. A `Dialect` is the notation of types,
constants and choices: plain C99 for a single sample (`vsacli.control.codegen.scalar`), or vectors with one
sample in each lane (`vsacli.compute.engine.lanes`). `Tables` merges the constant tables of programs into few
arrays.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from vsacli.compute.tracing.program import (
    BITWISE,
    LOGICAL,
    Kind,
    Operand,
    Program,
    SelectionTable,
    Symbol,
    kind_of,
    kinds_of_operands,
    table_uses,
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
"""Functions of math.h whose names differ from NumPy's."""

REAL_TYPES = ("double", "float")
"""Types of C for real numbers."""

Names = Mapping[int, str]
"""Names of the inputs of a program, by index."""


class ConstantArray(NamedTuple):
    """An array of constants.

    Attributes:
        name: Name in C.
        type: Type of the entries in C.
        values: Entries.
    """

    name: str
    type: str
    values: tuple[float, ...]


class TableLocation(NamedTuple):
    """Place of a table: an array and an offset."""

    array: ConstantArray
    offset: int

    @property
    def pointer(self) -> str:
        """C expression of a pointer to the first entry."""
        return f"{self.array.name} + {self.offset}" if self.offset else self.array.name


ArrayType = Callable[[tuple[float, ...], bool], str]
"""Function from values, and whether they are searched, to the C type of their array."""


class Tables:
    """All tables of some programs.

    Args:
        programs: Programs with the tables.
        array_type: Type of the entries of each array.

    Attributes:
        arrays: Arrays that contain the tables, the longest first.
    """

    def __init__(self, programs: Iterable[Program], array_type: ArrayType) -> None:
        uses = list(table_uses(*programs))
        tables = dict.fromkeys(table for table, _ in uses)
        arrays: list[tuple[float, ...]] = []
        self._locations = {
            table: _find_or_append(arrays, table.values)
            for table in sorted(tables, key=lambda table: -len(table.values))
        }
        searched = {self._locations[table][0] for table, operation in uses if operation == "searchsorted"}
        self.arrays = [
            ConstantArray(f"table_{index}", array_type(values, index in searched), values)
            for index, values in enumerate(arrays)
        ]

    def place(self, table: SelectionTable) -> TableLocation:
        """Return the place of a table."""
        index, offset = self._locations[table]
        return TableLocation(self.arrays[index], offset)


def _find_or_append(arrays: list[tuple[float, ...]], values: tuple[float, ...]) -> tuple[int, int]:
    """Return the index of an array that contains the values bit for bit, or of a new one, and the offset."""
    entries = array("d", values)
    for index, array_values in enumerate(arrays):
        array_bytes, byte_offset = array("d", array_values).tobytes(), -1
        while (byte_offset := array_bytes.find(entries.tobytes(), byte_offset + 1)) >= 0:
            if byte_offset % entries.itemsize == 0:
                return index, byte_offset // entries.itemsize
    arrays.append(values)
    return len(arrays) - 1, 0


class Dialect(NamedTuple):
    """The notation of values and operations in C, for `Writer`.

    Attributes:
        types: C type of each kind of value.
        real: Writes a real constant.
        literal: Writes a real constant in an array.
        array_type: Chooses the type of the entries of an array.
        take: Writes the entry of a table at an index.
        function: Names the function for values of a kind: one of math.h; `maximum`, `minimum`, which let NaN
            pass; or `search` in a table, which is given as a pointer and a number of entries.
        templates: `integer` (a constant field of bits or index), `true`, `false`; `and`, `or`, `not` of truth
            values; `bits` (a mask where a truth value holds, else 0); `any` (whether a truth value holds for
            any sample, as a condition of C); `spread` (a real value from an array of constants).
        where: Template, for each kind, of one of two values by a truth value.
        replaced: Template of a new value where a truth value holds, else the old one, in a block of C that
            is entered where it holds for any sample.
    """

    types: Mapping[Kind, str]
    real: Callable[[float], str]
    literal: Callable[[float], str]
    array_type: ArrayType
    take: Callable[[TableLocation, str], str]
    function: Callable[[Kind, str], str]
    templates: Mapping[str, str]
    where: Mapping[Kind, str]
    replaced: Mapping[Kind, str]

    def constant(self, value: float | int | bool, kind: Kind) -> str:
        """Return a constant of a kind."""
        if kind is Kind.TRUTH:
            return self.templates["true" if value else "false"]
        if kind is Kind.REAL:  # a tolerance must stay one: single precision takes a larger
            return self.real(value if isinstance(value, float) else float(value))
        return self.write("integer", int(value))

    def entry(self, number: float, array_type: str) -> str:
        """Return a constant in an array of a type."""
        return self.literal(number) if array_type in REAL_TYPES else str(int(number))

    def write(self, template: str, *operands: Any) -> str:
        """Return one of `templates` with these operands."""
        return self.templates[template].format(*operands)

    def call(self, kind: Kind, name: str, operands: Sequence[str]) -> str:
        """Return a call of a function that gives a value of a kind."""
        return f"{self.function(kind, name)}({', '.join(operands)})"

    def from_slot(self, kind: Kind, slot: str) -> str:
        """Return the value of a kind that is stored in a place for real values."""
        return slot if kind is Kind.REAL else f"({self.types[kind]}){slot}"

    def to_slot(self, kind: Kind, value: str) -> str:
        """Return a value of a kind as stored in a place for real values, exact for all flags and indices."""
        return value if kind is Kind.REAL else f"({self.types[Kind.REAL]}){value}"


def digits(number: float) -> str:
    """Return a constant with all digits; NaN and infinity by their names in math.h."""
    if math.isnan(number):
        return "NAN"
    if math.isinf(number):
        return "INFINITY" if number > 0 else "(-INFINITY)"
    return f"({number!r})" if number < 0 else repr(number)


class Writer:
    """Writes programs in a dialect.

    Args:
        dialect: Notation of the target language.
        tables: Tables of constants.
        subroutines: Names the function of a subroutine.
    """

    def __init__(
        self, dialect: Dialect, tables: Tables, subroutines: Callable[[Program], str] | None = None
    ) -> None:
        self.dialect = dialect
        self._tables = tables
        self._subroutine_name = subroutines

    def statements(self, operations: Iterable[Symbol], names: Names, prefix: str = "v") -> Iterator[str]:
        """Yield declarations of the values of operations in order; names of values begin with the prefix."""
        for symbol in operations:
            if symbol.operation == "subroutine":
                yield from self._subroutine_statements(symbol, names, prefix)
            elif symbol.operation == "loop":
                yield from self._loop_statements(symbol, names, prefix)
            elif symbol.operation == "branch":
                yield from self._branch_statements(symbol, names, prefix)
            elif symbol.operation != "item":
                name, text = _symbol_name(symbol, names, prefix), self._expression(symbol, names, prefix)
                yield f"const {self.dialect.types[symbol.kind]} {name} = {text};"

    def value(self, operand: Operand, kind: Kind, names: Names, prefix: str = "v") -> str:
        """Return a value, or a constant of that kind."""
        if isinstance(operand, Symbol):
            return _symbol_name(operand, names, prefix)
        return self.dialect.constant(operand, kind)

    def _expression(self, symbol: Symbol, names: Names, prefix: str) -> str:
        operation, dialect = symbol.operation, self.dialect
        if isinstance(table := symbol.operands[0], SelectionTable):
            return self._table_expression(table, symbol, names, prefix)
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
            return dialect.where[symbol.kind].format(*texts)
        if operation == "bits":
            return dialect.write("bits", *texts)
        if operation in LOGICAL:
            return dialect.write(LOGICAL[operation], *texts)
        return dialect.call(symbol.kind, C_NAMES.get(operation, operation), texts)

    def definition(self, head: str, program: Program, names: Names, results: str) -> Iterator[str]:
        """Yield a function that writes the results of a program to an array of real numbers."""
        yield head
        yield "{"
        yield from self.statements(program.operations, names)
        for number, output in enumerate(program.outputs):
            yield f"{results}[{number}] = {self.value(output, Kind.REAL, names)};"
        yield "}"

    def _subroutine_statements(self, symbol: Symbol, names: Names, prefix: str) -> Iterator[str]:
        """Yield an array of the results, and the statements that fill it."""
        assert self._subroutine_name is not None
        (body,), *operands = symbol.operands
        result_name = _symbol_name(symbol, names, prefix)
        arguments = [self.value(operand, Kind.REAL, names, prefix) for operand in operands]
        yield f"{self.dialect.types[Kind.REAL]} {result_name}[{len(body.outputs)}];"
        yield f"{self._subroutine_name(body)}({', '.join([*arguments, result_name])});"

    def _table_expression(self, table: SelectionTable, symbol: Symbol, names: Names, prefix: str) -> str:
        location, takes_entry = self._tables.place(table), symbol.operation == "take"
        operand = self.value(symbol.operands[1], Kind.INDEX if takes_entry else Kind.REAL, names, prefix)
        if takes_entry:
            return self.dialect.take(location, operand)
        arguments = (location.pointer, str(len(table.values)), operand)
        return self.dialect.call(Kind.INDEX, C_NAMES[symbol.operation], arguments)

    def _loop_statements(self, symbol: Symbol, names: Names, prefix: str) -> Iterator[str]:
        """Yield the variables of the state, and the loop that changes them."""
        loop, *operands = symbol.operands
        result_name, body, dialect = _symbol_name(symbol, names, prefix), loop.body, self.dialect
        state_names = [f"{result_name}_{index}" for index in loop.indices]
        kinds = [symbol.kind for symbol in body.inputs]
        operand_texts = [
            self.value(operand, kind, names, prefix) for operand, kind in zip(operands, kinds, strict=True)
        ]
        running, step = f"{result_name}_going", f"{result_name}_step"
        yield f"{dialect.types[Kind.TRUTH]} {running} = {dialect.constant(True, Kind.TRUTH)};"
        yield from self._declare_variables(state_names, operand_texts, kinds)
        yield f"for (int {step} = 0; {step} < {loop.limit} && {dialect.write('any', running)}; {step}++) {{"
        input_names = _argument_names(body, [*state_names, *operand_texts[len(state_names) :]])
        yield from self._body_statements(body, result_name, input_names, state_names, running)
        done = self.value(body.outputs[-1], Kind.TRUTH, input_names, f"{result_name}_v")
        not_done = dialect.write("not", done)
        yield f"{running} = {dialect.write('and', running, f'({not_done})')};"
        yield "}"

    def _branch_statements(self, symbol: Symbol, names: Names, prefix: str) -> Iterator[str]:
        """Yield the variables of the results, and the block that changes them."""
        branch, *operands = symbol.operands
        result_name, body, dialect = _symbol_name(symbol, names, prefix), branch.body, self.dialect
        output_count = len(body.outputs)
        truth, otherwise, arguments = (
            operands[0],
            operands[1 : 1 + output_count],
            operands[1 + output_count :],
        )
        results = [f"{result_name}_{index}" for index in branch.indices]
        kinds = [kind_of(output) for output in body.outputs]
        initial_texts = [
            self.value(operand, kind, names, prefix) for operand, kind in zip(otherwise, kinds, strict=True)
        ]
        yield from self._declare_variables(results, initial_texts, kinds)
        mask = self.value(truth, Kind.TRUTH, names, prefix)
        yield f"if ({dialect.write('any', mask)}) {{"
        argument_texts = [
            self.value(operand, symbol.kind, names, prefix)
            for operand, symbol in zip(arguments, body.inputs, strict=True)
        ]
        yield from self._body_statements(
            body, result_name, _argument_names(body, argument_texts), results, mask
        )
        yield "}"

    def _declare_variables(self, names: list[str], values: list[str], kinds: list[Kind]) -> Iterator[str]:
        for name, value, kind in zip(names, values, kinds, strict=False):
            yield f"{self.dialect.types[kind]} {name} = {value};"

    def _body_statements(
        self, body: Program, result_name: str, names: Names, results: list[str], mask: str
    ) -> Iterator[str]:
        """Yield the statements of a body, and the simultaneous assignment of its outputs."""
        prefix = f"{result_name}_v"
        yield from self.statements(body.operations, names, prefix)
        kinds = [kind_of(output) for output in body.outputs]
        for result, output, kind in zip(results, body.outputs, kinds, strict=False):
            value = self.value(output, kind, names, prefix)
            yield f"const {self.dialect.types[kind]} {result}_new = {value};"
        for result, kind in zip(results, kinds, strict=False):
            yield f"{result} = {self.dialect.replaced[kind].format(mask, f'{result}_new', result)};"


def table_declarations(tables: Tables, dialect: Dialect) -> Iterator[str]:
    """Yield the declarations of constants at the head of a file."""
    for name, array_type, values in tables.arrays:
        entries = ", ".join(dialect.entry(value, array_type) for value in values)
        yield f"static const {array_type} {name}[{len(values)}] = {{{entries}}};"


def _symbol_name(symbol: Symbol, names: Names, prefix: str) -> str:
    if symbol.operation == "item" and symbol.index not in names:
        container, index = symbol.operands
        container_name = _symbol_name(container, names, prefix)
        return (
            f"{container_name}[{index}]"
            if container.operation == "subroutine"
            else f"{container_name}_{index}"
        )
    return names.get(symbol.index, f"{prefix}{symbol.index}")


def _argument_names(body: Program, texts: list[str]) -> Names:
    """Return the names of the inputs of a body: the texts of its arguments."""
    return {symbol.index: text for symbol, text in zip(body.inputs, texts, strict=True)}
