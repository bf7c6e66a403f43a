"""C99 code of traced programs, for one sample at a time."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from vsacli.compute.rounding import single_constant
from vsacli.compute.tracing import Kind, Symbol, is_of_calls
from vsacli.compute.tracing.c_code import (
    REAL_TYPES,
    Dialect,
    Names,
    TableLocation,
    Tables,
    Writer,
    digits,
    table_declarations,
)
from vsacli.compute.tracing.c_functions import VALUES, CallingCode, Subroutines
from vsacli.control.codegen.interface import Function, Step, Structure, structures

PRECISIONS = REAL_TYPES

WIDTH = 110
"""Largest number of characters in a line, except for comments after code."""

HELPERS = {
    "maximum": "{type} maximum({type} a, {type} b) {{ return a >= b || a != a ? a : b; }}",
    "minimum": "{type} minimum({type} a, {type} b) {{ return a <= b || a != a ? a : b; }}",
    "maximum_index": "int maximum_index(int a, int b) {{ return a >= b ? a : b; }}",
    "minimum_index": "int minimum_index(int a, int b) {{ return a <= b ? a : b; }}",
    "search": """/* Number of increasing nodes that x is not below. */
static inline int search(const {type} *nodes, int count, {type} x)
{{
    int low = 0, high = count;
    while (low < high) {{
        const int middle = (low + high) / 2;
        if (x < nodes[middle])
            high = middle;
        else
            low = middle + 1;
    }}
    return low;
}}""",
}
"""Functions beyond math.h; maximum and minimum return NaN if either argument is NaN."""


def _holds_float(value: float) -> bool:
    """Return whether single precision represents a number exactly, and does not underflow."""
    return math.isnan(value) or (single_constant(value) == value and float(np.float32(value)) == value)


def _holds_integer(largest: int) -> Callable[[float], bool]:
    """Return the test whether a value is an integer of at most this magnitude; minus zero fails it."""
    return lambda value: abs(value) <= largest and value == int(value) and str(value) != "-0.0"


_SMALLER_TYPES = {
    "signed char": _holds_integer(127),
    "short": _holds_integer(32767),
    "float": _holds_float,
}
"""Types smaller than the precision, each with the test whether it represents a value exactly."""

BYTES = {"signed char": 1, "short": 2, "float": 4, "double": 8}
"""Size of each type in bytes."""


def scalar_dialect(precision: str) -> Dialect:
    """Return the dialect of plain C99 for a single sample.

    Args:
        precision: one of `PRECISIONS`.
    """
    literal = _single_literal if precision == "float" else _double_literal
    suffix = "f" if precision == "float" else ""

    def array_type(values: tuple[float, ...], searched: bool) -> str:
        """Return the smallest type that represents all values exactly, else the precision's."""
        smaller_types = () if searched else _SMALLER_TYPES.items()
        return next((name for name, represents in smaller_types if all(map(represents, values))), precision)

    def take(location: TableLocation, index: str) -> str:
        entry = f"{location.array.name}[{index}{f' + {location.offset}' if location.offset else ''}]"
        return entry if location.array.type == precision else f"({precision}){entry}"

    def function(kind: Kind, name: str) -> str:
        if name == "search":
            return name
        if name in HELPERS:
            return f"{name}_index" if kind is Kind.INDEX else name
        return f"{name}{suffix}"

    return Dialect(
        types={Kind.REAL: precision, Kind.TRUTH: "int", Kind.BITS: "unsigned", Kind.INDEX: "int"},
        real=literal,
        literal=literal,
        array_type=array_type,
        take=take,
        function=function,
        templates={
            "integer": "{0}",
            "true": "1",
            "false": "0",
            "and": "{0} && {1}",
            "or": "{0} || {1}",
            "not": "!{0}",
            "bits": "{0} ? {1}u : 0u",
            "any": "{0}",
            "spread": "{0}",
        },
        where=dict.fromkeys(Kind, "{0} ? {1} : {2}"),
        replaced=dict.fromkeys(Kind, "{1}"),
    )


def _double_literal(number: float) -> str:
    """Return a constant as a double; NAN and INFINITY of math.h are floats."""
    return digits(number).replace("INFINITY", "HUGE_VAL").replace("NAN", "(double)NAN")


def _single_literal(number: float) -> str:
    text = digits(single_constant(number))
    if "N" in text:
        return text
    return text.replace(")", "f)") if text.endswith(")") else f"{text}f"


def definitions(prefix: str, functions: Sequence[Function], precision: str) -> Iterator[str]:
    """Yield the definitions of the source file: constants, tables, helpers, subroutines, functions."""
    dialect = scalar_dialect(precision)
    programs = [function.program for function in functions if not isinstance(function, Step)]
    tables = Tables(programs, dialect.array_type)
    subroutines = Subroutines(programs)
    writer = Writer(dialect, tables, subroutines.name)
    bodies = ["\n".join(indented(text)) for text in subroutines.functions(writer)]
    bodies += ["\n".join(_function_lines(prefix, function, writer)) for function in functions]
    called_names = {word for body in bodies for word in re.findall(r"\b[a-z_]+(?=\()", body)}
    yield from (
        _nominal_constant(prefix, structure, dialect)
        for structure in structures(functions)
        if structure.nominal
    )
    if declarations := list(table_declarations(tables, dialect)):
        yield "\n".join(declarations)
    yield from (helper_text(name, precision) for name in HELPERS if name in called_names)
    yield from bodies


def further_definitions(
    prefix: str, declared: Sequence[Function], functions: Sequence[Function], precision: str
) -> Iterator[str]:
    """Yield the definitions of functions for a file that includes the source file of others."""
    declared_texts = set(definitions(prefix, declared, precision))
    all_texts = definitions(prefix, [*declared, *functions], precision)
    yield from (text for text in all_texts if text not in declared_texts)


def _nominal_constant(prefix: str, structure: Structure, dialect: Dialect) -> str:
    """Return the definition of the constant with the nominal values of a structure."""
    values = zip(structure.entries, structure.nominal, strict=True)
    members = (f"    .{entry} = {dialect.real(value)},\n" for entry, value in values)
    name = f"{prefix}_{structure.name} {prefix}_nominal_{structure.name}"
    return f"const {name} = {{\n{''.join(members)}}};"


def helper_text(name: str, precision: str) -> str:
    """Return the definition of a function of `HELPERS`."""
    text = HELPERS[name].format(type=precision)
    return text if text.startswith("/*") else f"static inline {text}"


def signature(prefix: str, function: Function, precision: str) -> str:
    """Return the declarator of a function, with one argument per line if a single line is too long."""
    arguments = [
        f"{precision} {name}" if structure.by_value else f"const {prefix}_{structure.name} *{name}"
        for name, structure in function.arguments
    ]
    result = f"{prefix}_{function.result.name} *{function.output}"
    lines = [f"unsigned {prefix}_{function.name}({', '.join([*arguments, result])})"]
    if len(lines[0]) > WIDTH:
        lines = [f"unsigned {prefix}_{function.name}(", ",\n    ".join([*arguments, result]) + ")"]
    return "\n    ".join(lines)


def indented(lines: Iterable[str], depth: int = 0) -> Iterator[str]:
    """Yield lines of C, indented by their braces."""
    for line in lines:
        depth -= line == "}"
        yield "    " * depth + line
        depth += line.endswith("{")


def _function_lines(prefix: str, function: Function, writer: Writer) -> Iterator[str]:
    if isinstance(function, Step):
        yield from _step_definition(prefix, function, writer)
        return
    program, entries = function.program, function.inputs
    head = f"{signature(prefix, function, writer.dialect.types[Kind.REAL])}\n{{"
    if is_of_calls(program):
        code = CallingCode(function.name, program, writer)
        yield from indented(code.declarations("static"))
        yield head
        yield f"    {writer.dialect.types[Kind.REAL]} {VALUES}[{code.slot_count}];"
        yield from (f"    {VALUES}[{slot}] = {entry};" for slot, entry in enumerate(entries))
        yield from (f"    {line}" for line in code.statements())
        outputs = (output for output in program.outputs if isinstance(output, Symbol))
        names = {output.index: code.value(output, code.slot[output.index]) for output in outputs}
    else:
        names = {symbol.index: entry for symbol, entry in zip(program.inputs, entries, strict=True)}
        yield head
        yield from indented(writer.statements(program.operations, names), 1)
    yield from _result_lines(function, writer, names)


def _step_definition(prefix: str, step: Step, writer: Writer) -> Iterator[str]:
    """Yield the definition of a step, which calls the function of the derivative at each stage."""
    program, derivative = step.program, step.derivative
    names = {symbol.index: entry for symbol, entry in zip(program.inputs, step.inputs, strict=True)}
    rates, flags = list(derivative.result.entries), list[str]()
    (_, state), *held_arguments = derivative.arguments
    yield f"{signature(prefix, step, writer.dialect.types[Kind.REAL])}\n{{"
    for symbol in program.operations:
        if symbol.operation == "item":
            names[symbol.index] = f"rates_{len(flags)}.{rates[symbol.operands[1]]}"
        elif symbol.operation == "subroutine":
            stage = len(flags) + 1
            flags.append(f"flags_{stage}")
            yield f"    {prefix}_{state.name} state_{stage};"
            yield f"    {prefix}_{derivative.result.name} rates_{stage};"
            for entry, operand in zip(state.entries, symbol.operands[1:], strict=False):
                yield f"    state_{stage}.{entry} = {writer.value(operand, Kind.REAL, names)};"
            call_arguments = ", ".join(
                [f"&state_{stage}", *(name for name, _ in held_arguments), f"&rates_{stage}"]
            )
            yield f"    const unsigned flags_{stage} = {prefix}_{derivative.name}({call_arguments});"
        else:
            yield from indented(writer.statements([symbol], names), 1)
    yield from _result_lines(step, writer, names, flags)


def _result_lines(
    function: Function, writer: Writer, names: Names, flags: Sequence[str] = ()
) -> Iterator[str]:
    """Yield the statements that store the results, and return their flags together with others."""
    program, flags = function.program, list(flags)
    outputs = iter(program.outputs)
    for array in function.result.arrays:
        for entry in array.entries:
            output = next(outputs)
            kind = Kind.BITS if array.bits else Kind.REAL
            value = writer.value(output, kind, names)
            yield f"    {function.output}->{entry} = {value};"
            flags += [value] if array.bits and isinstance(output, Symbol) else []
    yield f"    return {' | '.join(flags) or '0u'};"
    yield "}"
