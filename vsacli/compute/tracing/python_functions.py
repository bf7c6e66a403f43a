"""Programs as Python functions.

`function_text` writes a function that uses NumPy's function names. With these names bound to NumPy it
computes rows of samples; bound to functions of plain numbers it computes a single sample, fifty times faster
than the kernel itself.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from types import CodeType
from typing import Any, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, by_joint, over_time
from vsacli.compute.tracing.array import TracedArray, cells_of
from vsacli.compute.tracing.c_code import INFIX
from vsacli.compute.tracing.program import (
    FUNCTIONS,
    Branch,
    Kind,
    Loop,
    Program,
    SelectionTable,
    Symbol,
    kinds_of_operands,
    table_uses,
)

_NOTATIONS = {
    "where": "{1} if {0} else {2}",
    "take": "{0}[{1}]",
    "negative": "-{0}",
    "bits": "{1} if {0} else 0",
}

NumberFunction = Callable[[Sequence[float]], list[float]]
"""Function from the inputs of a program to its outputs.

Raises ArithmeticError or ValueError where Python raises instead of returning NaN or infinity."""

_NUMBER_FUNCTIONS: dict[str, Any] = {
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

NESTING = 20
"""Depth of expressions. Values that are used once are not assigned; otherwise `link_torques` of seven joints
takes 1.7 times as long. Deeper expressions save no more, and Python's parser has a limit."""


def _scalar_ufunc(name: str) -> Callable[..., float]:
    """Return a function of NumPy that returns a plain number, with which Python computes faster."""
    function = getattr(np, name)
    if function.nin == 1:
        return lambda operand: float(function(operand))
    return lambda *operands: float(function(*operands))


def _square_root(number: float) -> float:
    return math.sqrt(number) if number >= 0 else math.nan


_EXACT_FUNCTIONS: dict[str, Any] = {
    **{name: _scalar_ufunc(name) for name in sorted(FUNCTIONS - {"absolute", "copysign"})},
    "sqrt": _square_root,
}
"""Functions with the results of NumPy to the last bit; the square root is rounded correctly in both."""


def function_text(program: Program, name: str, arguments: Mapping[str, int], nesting: int = 0) -> str:
    """Return the text of a function from sequences of numbers to the list of the program's outputs.

    Args:
        program: Program without calls and subroutines.
        name: Name of the function.
        arguments: Number of inputs in each argument, by name.
        nesting: Largest depth of expressions; values that are used once are then not assigned.

    Raises:
        NotImplementedError: The program has calls or subroutines.
    """
    tables = dict.fromkeys(table for table, _ in table_uses(program))
    writer = _PythonWriter({table: f"table_{index}" for index, table in enumerate(tables)}, nesting)
    constants = [f"{table_name} = array({list(table.values)})" for table, table_name in writer.tables.items()]
    value_names = {symbol.index: f"v{symbol.index}" for symbol in program.inputs}
    inputs, lines = iter(program.inputs), []
    for argument, count in arguments.items():
        lines.append(f"{', '.join(value_names[next(inputs).index] for _ in range(count))}, = {argument}")
    results = writer.body(program, value_names, "v", lines)
    head = f"def {name}({', '.join(arguments)}):"
    return "\n".join([*constants, head, *_indented_lines([*lines, f"return [{', '.join(results)}]"]), ""])


class _NestedText(NamedTuple):
    """Expression of a value that is used once, and its depth."""

    text: str
    depth: int


class _PythonWriter:
    """Writes the statements of programs in Python.

    Args:
        tables: Name of each table.
        nesting: As of `function_text`.
    """

    def __init__(self, tables: Mapping[SelectionTable, str], nesting: int) -> None:
        self.tables, self._nesting = tables, nesting

    def body(self, program: Program, names: dict[int, str], prefix: str, lines: list[str]) -> list[str]:
        """Append the statements of a program, and return expressions of its outputs.

        Args:
            program: Program.
            names: Names of its inputs by index; names of values are added.
            prefix: Beginning of the names of values.
            lines: Statements so far.
        """
        use_counts = Counter(
            operand.index
            for operands in (*(symbol.operands for symbol in program.operations), program.outputs)
            for operand in operands
            if isinstance(operand, Symbol)
        )
        nested_texts: dict[int, _NestedText] = {}

        def value_text(operand: Any) -> str:
            if isinstance(operand, Symbol) and operand.index in nested_texts:
                return nested_texts[operand.index].text
            return self._operand_text(operand, names)

        for symbol in program.operations:
            result_name = f"{prefix}{symbol.index}"
            if symbol.operation == "item":
                names[symbol.index] = f"{names[symbol.operands[0].index]}_{symbol.operands[1]}"
            elif symbol.operation in ("loop", "branch"):
                names[symbol.index] = result_name
                write = self._write_loop if symbol.operation == "loop" else self._write_branch
                write(symbol.operands[0], result_name, list(map(value_text, symbol.operands[1:])), lines)
            else:
                operand_depths = [
                    nested_texts[nested_operand.index].depth
                    for nested_operand in symbol.operands
                    if isinstance(nested_operand, Symbol) and nested_operand.index in nested_texts
                ]
                depth = 1 + max(operand_depths, default=0)
                expression = self._expression(symbol, list(map(value_text, self._typed_operands(symbol))))
                if use_counts[symbol.index] == 1 and depth <= self._nesting:
                    nested_texts[symbol.index] = _NestedText(f"({expression})", depth)
                else:
                    names[symbol.index] = result_name
                    lines.append(f"{result_name} = {expression}")
        return list(map(value_text, program.outputs))

    def _write_loop(self, loop: Loop, result_name: str, operand_texts: list[str], lines: list[str]) -> None:
        """Append a loop whose state has names such as `v5_0`."""
        state_names = [f"{result_name}_{index}" for index in loop.indices]
        constant_names = [f"{result_name}_c{index}" for index in range(len(operand_texts) - len(state_names))]
        lines += [
            f"{name} = {text}"
            for name, text in zip([*state_names, *constant_names], operand_texts, strict=True)
        ]
        body_lines: list[str] = []
        names = _input_names(loop.body, [*state_names, *constant_names])
        results = self.body(loop.body, names, f"{result_name}_v", body_lines)
        body_lines.append(f"{', '.join([*state_names, f'{result_name}_done'])} = {', '.join(results)}")
        body_lines += [f"if {result_name}_done:", "    break"]
        lines += [f"for _ in range({loop.limit}):", *_indented_lines(body_lines)]

    def _write_branch(
        self, branch: Branch, result_name: str, operand_texts: list[str], lines: list[str]
    ) -> None:
        """Append a conditional whose results have names such as `v5_0`."""
        count = len(branch.body.outputs)
        truth, otherwise, arguments = (
            operand_texts[0],
            operand_texts[1 : 1 + count],
            operand_texts[1 + count :],
        )
        result_names = [f"{result_name}_{index}" for index in branch.indices]
        constant_names = [f"{result_name}_c{index}" for index in range(len(arguments))]
        body_lines = [f"{name} = {text}" for name, text in zip(constant_names, arguments, strict=True)]
        names = _input_names(branch.body, constant_names)
        output_texts = self.body(branch.body, names, f"{result_name}_v", body_lines)
        body_lines += [f"{name} = {text}" for name, text in zip(result_names, output_texts, strict=True)]
        else_lines = [f"{name} = {text}" for name, text in zip(result_names, otherwise, strict=True)]
        lines += [f"if {truth}:", *_indented_lines(body_lines), "else:", *_indented_lines(else_lines)]

    def _expression(self, symbol: Symbol, operands: list[str]) -> str:
        operation = symbol.operation
        if operation in {"call", "subroutine"}:
            raise NotImplementedError(f"a {operation} has no place in one function")
        if operation in _NOTATIONS:
            return _NOTATIONS[operation].format(*operands)
        if operation in INFIX:
            return f"{operands[0]} {INFIX[operation]} {operands[1]}"
        side = ", 'right'" if operation == "searchsorted" else ""
        return f"{operation}({', '.join(operands)}{side})"

    def _typed_operands(self, symbol: Symbol) -> list[Any]:
        """Return the operands of an operation; constants among bits as integers.

        Where a single sample counts, integers among real numbers become floats, with which Python multiplies
        faster.
        """
        if isinstance(symbol.operands[0], SelectionTable) or symbol.operation == "item":
            return list(symbol.operands)
        types = {Kind.BITS: int, **({Kind.REAL: float} if self._nesting else {})}
        return [
            operand if isinstance(operand, Symbol) or kind not in types else types[kind](operand)
            for operand, kind in zip(symbol.operands, kinds_of_operands(symbol), strict=True)
        ]

    def _operand_text(self, operand: Any, value_names: Mapping[int, str]) -> str:
        """Return a name, or a constant exactly."""
        if isinstance(operand, SelectionTable):
            return self.tables[operand]
        if isinstance(operand, Symbol):
            return value_names[operand.index]
        return f"({operand!r})" if operand < 0 else repr(operand)  # nan and inf are names of NumPy


def _input_names(body: Program, names: Sequence[str]) -> dict[int, str]:
    """Return the names of the inputs of a body by index."""
    return {symbol.index: name for symbol, name in zip(body.inputs, names, strict=True)}


def _indented_lines(lines: Sequence[str]) -> list[str]:
    return [f"    {line}" for line in lines]


def number_function(program: Program, exactly: bool = False) -> NumberFunction:
    """Return a program as a function of plain numbers.

    Args:
        program: Program.
        exactly: Whether results equal those of NumPy to the last bit; else functions of `math` are used,
            which differ by a rounding error.

    Raises:
        NotImplementedError: The program has calls or subroutines.
    """
    names = {**_NUMBER_FUNCTIONS, **_EXACT_FUNCTIONS} if exactly else dict(_NUMBER_FUNCTIONS)
    function: NumberFunction = define_function(_function_code(program), "run", names)
    return function


def _function_code(program: Program) -> CodeType:
    return compile_function(function_text(program, "run", {"values": len(program.inputs)}, NESTING))


def compile_function(text: str) -> CodeType:
    """Return the code of a text that defines a function."""
    return compile(text, "<traced program>", "exec")


def define_function(code: CodeType, name: str, names: dict[str, Any]) -> Callable[..., Any]:
    """Return the function with a name that code defines, with `names` as globals."""
    exec(code, names)
    function: Callable[..., Any] = names[name]
    return function


class StateFunction:
    """A program without control flow and tables, for single states or rows of states."""

    def __init__(self, program: Program) -> None:
        code = _function_code(program)
        self._on_numbers: NumberFunction = define_function(code, "run", dict(_NUMBER_FUNCTIONS))
        self._on_rows = define_function(code, "run", dict(vars(np)))

    def __call__(self, *inputs: FloatArray) -> FloatArray:
        """Run on arrays (n,) or (samples, n), whose columns are the inputs; the outputs have the same form.

        On traced arrays it becomes part of the program on their tape.
        """
        if isinstance(first := inputs[0], TracedArray):
            cells = np.concatenate([cells_of(array) for array in inputs])
            return TracedArray(first.tape, self._on_rows(cells))
        if inputs[0].ndim == 1:
            return np.array(self._on_numbers([number for array in inputs for number in array.tolist()]))
        outputs = self._on_rows([row for array in inputs for row in by_joint(array)])
        rows = np.empty((len(outputs), len(inputs[0])))
        for row, output in zip(rows, outputs, strict=True):
            row[:] = output
        return over_time(rows)
