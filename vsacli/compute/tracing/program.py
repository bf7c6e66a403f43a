"""Recorded programs of + - * / cos sin in Python: what single states of a simulation are computed with."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import CodeType, FunctionType
from typing import Any

import numpy as np

from vsacli.base.arrays import FloatArray, by_joint, over_time
from vsacli.compute.tracing.array import TracedArray, cells_of
from vsacli.compute.tracing.dead_code import Listing
from vsacli.compute.tracing.symbol import Operand, Symbol

_FORMS = {
    "add": "{} + {}",
    "subtract": "{} - {}",
    "multiply": "{} * {}",
    "divide": "{} / {}",
    "negative": "-{}",
    "cos": "cos({})",
    "sin": "sin({})",
}


class Program:
    """A recorded computation on single numbers or on rows of samples, some hundred times faster than Python.

    It is compiled to one function without a loop or a branch.
    """

    def __init__(self, listing: Listing) -> None:
        self.source = _source(listing)
        module = compile(self.source, "<recorded program>", "exec")
        code = next(constant for constant in module.co_consts if isinstance(constant, CodeType))
        self._on_numbers: Callable[..., list[Any]] = FunctionType(code, {"cos": math.cos, "sin": math.sin})
        self._on_rows: Callable[..., list[Any]] = FunctionType(code, {"cos": np.cos, "sin": np.sin})

    def __call__(self, *inputs: FloatArray) -> FloatArray:
        """Run on arrays (n,) or (samples, n), whose columns are the inputs; the outputs come likewise.

        On traced arrays it becomes part of the program that they record.
        """
        if isinstance(first := inputs[0], TracedArray):
            entries = np.concatenate([cells_of(array) for array in inputs])
            return TracedArray(first.tape, self._on_rows(*entries))
        if inputs[0].ndim == 1:
            return np.array(self._on_numbers(*(number for array in inputs for number in array.tolist())))
        outputs = self._on_rows(*(row for array in inputs for row in by_joint(array)))
        rows = np.empty((len(outputs), len(inputs[0])))
        for row, output in zip(rows, outputs, strict=True):
            row[:] = output
        return over_time(rows)


def _source(listing: Listing) -> str:
    arguments = ", ".join(map(_name, listing.inputs))
    lines = [
        f" {_name(symbol)} = {_FORMS[symbol.operation].format(*map(_name, symbol.operands))}"
        for symbol in listing.operations
    ]
    results = ", ".join(map(_name, listing.outputs))
    return "\n".join([f"def program({arguments}):", *lines, f" return [{results}]"])


def _name(operand: Operand) -> str:
    """Constants exactly."""
    return f"v{operand.index}" if isinstance(operand, Symbol) else repr(operand)
