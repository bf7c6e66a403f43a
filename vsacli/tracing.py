"""Straight-line programs recorded from a computation with + - * cos sin.

The recursion is a polynomial on arbitrary scalars. Run once on symbols it leaves a list of operations, shared
subexpressions once and without what the outputs do not need, which Python compiles to a function some hundred
times faster than the recursion on single numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from types import CodeType, FunctionType
from typing import Any

import numpy as np

from vsacli.arrays import FloatArray, by_joint, over_time
from vsacli.vector import Scalar


class Tape:
    """Operations in the order in which they were carried out, each distinct one once."""

    def __init__(self) -> None:
        self._name_of: dict[tuple[str, ...], str] = {}
        self._inputs: list[str] = []

    def inputs(self, count: int) -> list[Symbol]:
        """New variables, which the program receives in this order."""
        names = [f"x{len(self._inputs) + index}" for index in range(count)]
        self._inputs += names
        return [Symbol(self, name) for name in names]

    def record(self, operator: str, *operands: Scalar) -> Symbol:
        """The result of an operation on symbols and numbers."""
        names = [_name(operand) for operand in operands]
        key = (operator, *(sorted(names) if operator in "+*" else names))
        return Symbol(self, self._name_of.setdefault(key, f"v{len(self._name_of)}"))

    def program(self, outputs: Sequence[Scalar]) -> Program:
        """What computes these outputs from the inputs."""
        results = [_name(output) for output in outputs]
        needed, lines = set(results), []
        for (operator, *operands), name in reversed(self._name_of.items()):
            if name in needed:
                needed.update(operands)
                lines.append(f" {name} = {_expression(operator, operands)}")
        source = "\n".join(
            [f"def program({', '.join(self._inputs)}):", *reversed(lines), f" return [{', '.join(results)}]"]
        )
        return Program(source)


class Symbol:
    """The value of an input or of an operation, known only when the program runs."""

    __slots__ = ("_name", "_tape")

    def __init__(self, tape: Tape, name: str) -> None:
        self._tape = tape
        self._name = name

    def __str__(self) -> str:
        return self._name

    def __add__(self, other: Scalar) -> Symbol:
        return self._tape.record("+", self, other)

    def __sub__(self, other: Scalar) -> Symbol:
        return self._tape.record("-", self, other)

    def __mul__(self, other: Scalar) -> Symbol:
        return self._tape.record("*", self, other)

    def __rsub__(self, other: Scalar) -> Symbol:
        return self._tape.record("-", other, self)

    __radd__ = __add__
    __rmul__ = __mul__

    def __neg__(self) -> Symbol:
        return self._tape.record("-", self)

    def cos(self) -> Symbol:
        """Cosine; what `numpy.cos` calls."""
        return self._tape.record("cos", self)

    def sin(self) -> Symbol:
        """Sine; what `numpy.sin` calls."""
        return self._tape.record("sin", self)


class Program:
    """A recorded computation on single numbers or on rows of samples."""

    def __init__(self, source: str) -> None:
        self.source = source
        module = compile(source, "<recorded program>", "exec")
        code = next(constant for constant in module.co_consts if isinstance(constant, CodeType))
        self._on_numbers: Callable[..., list[Any]] = FunctionType(code, {"cos": math.cos, "sin": math.sin})
        self._on_rows: Callable[..., list[Any]] = FunctionType(code, {"cos": np.cos, "sin": np.sin})

    def __call__(self, *inputs: FloatArray) -> FloatArray:
        """Run on arrays (n,) or (samples, n), whose columns are the inputs; the outputs come likewise."""
        if inputs[0].ndim == 1:
            return np.array(self._on_numbers(*(number for array in inputs for number in array.tolist())))
        outputs = self._on_rows(*(row for array in inputs for row in by_joint(array)))
        rows = np.empty((len(outputs), len(inputs[0])))
        for row, output in zip(rows, outputs, strict=True):
            row[:] = output
        return over_time(rows)


def _name(operand: Scalar) -> str:
    """How an operand is written; numbers exactly, integers apart from floats as they fold differently."""
    if isinstance(operand, Symbol):
        return str(operand)
    return repr(operand if isinstance(operand, int) else float(operand))


def _expression(operator: str, operands: Sequence[str]) -> str:
    if len(operands) == 2:
        return f"{operands[0]} {operator} {operands[1]}"
    return f"-{operands[0]}" if operator == "-" else f"{operator}({operands[0]})"
