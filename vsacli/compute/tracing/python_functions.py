"""Programs as Python functions.

`function_text` writes a function that uses NumPy's function names. With these names bound to NumPy it
computes rows of samples; bound to functions of plain numbers it computes a single sample, about a hundred
times faster than the kernel itself.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from types import CodeType
from typing import Any

import numpy as np

from vsacli.base.arrays import FloatArray, by_joint, over_time
from vsacli.compute.tracing.array import TracedArray, cells_of
from vsacli.compute.tracing.c_code import INFIX
from vsacli.compute.tracing.program import LOGICAL, Program, Symbol, Table, table_uses

_CHOICES = {"where": "{1} if {0} else {2}", "take": "{0}[{1}]", "negative": "-{0}"}

NumberFunction = Callable[[Sequence[float]], list[float]]
"""Function from the inputs of a program to its outputs.

Raises ArithmeticError or ValueError where Python raises instead of returning NaN or infinity."""

_ON_NUMBERS: dict[str, Any] = {
    **{name: getattr(math, name) for name in ("sqrt", "cbrt", "exp", "expm1", "log", "log1p", "hypot")},
    **{name: getattr(math, name) for name in ("copysign", "sin", "cos", "tan", "sinh", "cosh", "tanh")},
    **{f"arc{name}": getattr(math, f"a{name}") for name in ("sin", "cos", "tan", "tan2", "sinh")},
    "power": math.pow,
    "absolute": abs,
    "maximum": lambda a, b: a if a >= b or a != a else b,
    "minimum": lambda a, b: a if a <= b or a != a else b,
    "isnan": math.isnan,
    "logical_and": lambda a, b: a and b,
    "logical_or": lambda a, b: a or b,
    "logical_not": lambda a: not a,
    "searchsorted": lambda nodes, x, _side: bisect_right(nodes, x),
    "array": tuple,
    "nan": math.nan,
    "inf": math.inf,
}
"""Equivalents of NumPy's functions on plain numbers."""


def function_text(program: Program, name: str, arguments: Mapping[str, int]) -> str:
    """Return the text of a function from sequences of numbers to the list of the program's outputs.

    Args:
        program: Program without loops and branches.
        name: Name of the function.
        arguments: Number of inputs in each argument, by name.

    Raises:
        NotImplementedError: The program has loops or branches.
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
    """Return a name, or a constant exactly."""
    if isinstance(operand, Symbol):
        return f"v{operand.index}"
    return f"({operand!r})" if operand < 0 else repr(operand)  # nan and inf are names of NumPy


def number_function(program: Program) -> NumberFunction:
    """Return a program as a function of plain numbers.

    Raises:
        NotImplementedError: The program has loops or branches.
    """
    function: NumberFunction = defined(_code(program), "run", dict(_ON_NUMBERS))
    return function


def _code(program: Program) -> CodeType:
    return compiled(function_text(program, "run", {"values": len(program.inputs)}))


def compiled(text: str) -> CodeType:
    """Return the code of a text that defines a function."""
    return compile(text, "<traced program>", "exec")


def defined(code: CodeType, name: str, names: dict[str, Any]) -> Callable[..., Any]:
    """Return the function with a name that code defines, with `names` as globals."""
    exec(code, names)
    function: Callable[..., Any] = names[name]
    return function


class StateFunction:
    """A program without control flow and tables, for single states or rows of states."""

    def __init__(self, program: Program) -> None:
        code = _code(program)
        self._on_numbers: NumberFunction = defined(code, "run", dict(_ON_NUMBERS))
        self._on_rows = defined(code, "run", dict(vars(np)))

    def __call__(self, *inputs: FloatArray) -> FloatArray:
        """Run on arrays (n,) or (samples, n), whose columns are the inputs; the outputs have the same form.

        On traced arrays it becomes part of the program on their tape.
        """
        if isinstance(first := inputs[0], TracedArray):
            entries = np.concatenate([cells_of(array) for array in inputs])
            return TracedArray(first.tape, self._on_rows(entries))
        if inputs[0].ndim == 1:
            return np.array(self._on_numbers([number for array in inputs for number in array.tolist()]))
        outputs = self._on_rows([row for array in inputs for row in by_joint(array)])
        rows = np.empty((len(outputs), len(inputs[0])))
        for row, output in zip(rows, outputs, strict=True):
            row[:] = output
        return over_time(rows)
