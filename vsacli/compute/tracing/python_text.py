"""Programs as the text of a Python function that needs NumPy alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vsacli.compute.tracing.c_code import INFIX
from vsacli.compute.tracing.c_tables import table_uses
from vsacli.compute.tracing.program import LOGICAL, Program, Symbol, Table

_CHOICES = {"where": "{1} if {0} else {2}", "take": "{0}[{1}]", "negative": "-{0}"}


def function_text(program: Program, name: str, arguments: Mapping[str, int]) -> str:
    """A function of sequences of numbers that returns the list of the program's outputs.

    It calls functions by their names in NumPy.

    Args:
        program: one without loops and branches.
        name: of the function.
        arguments: how many inputs there are in each of its arguments, by name.

    Raises:
        NotImplementedError: the program has loops or branches.
    """
    distinct = dict.fromkeys(table for table, _ in table_uses(program))
    tables = {table: f"table_{number}" for number, table in enumerate(distinct)}
    inputs, lines = iter(program.inputs), []
    for argument, count in arguments.items():
        lines.append(f"    {', '.join(_value(next(inputs)) for _ in range(count))}, = {argument}")
    lines += [f"    v{symbol.index} = {_expression(symbol, tables)}" for symbol in program.operations]
    results = ", ".join(map(_value, program.outputs))
    head = f"def {name}({', '.join(arguments)}):"
    constants = [f"{own} = array({list(table.values)})" for table, own in tables.items()]
    return "\n".join([*constants, head, *lines, f"    return [{results}]", ""])


def _expression(symbol: Symbol, tables: Mapping[Table, str]) -> str:
    operation = symbol.operation
    operands = [tables[each] if isinstance(each, Table) else _value(each) for each in symbol.operands]
    if operation in {"loop", "branch", "item", "bits"}:
        raise NotImplementedError(f"a {operation} has no place in one expression")
    if operation in _CHOICES:
        return _CHOICES[operation].format(*operands)
    if operation in INFIX:
        return f"{operands[0]} {INFIX[operation]} {operands[1]}"
    if operation in LOGICAL:
        return f"{operation}({', '.join(operands)})"
    side = ", 'right'" if operation == "searchsorted" else ""
    return f"{operation}({', '.join(operands)}{side})"


def _value(operand: Any) -> str:
    """A name, or a constant exactly."""
    if isinstance(operand, Symbol):
        return f"v{operand.index}"
    return f"({operand!r})" if operand < 0 else repr(operand)  # nan and inf are names of NumPy
