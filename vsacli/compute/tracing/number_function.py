"""Programs as Python functions of plain numbers, for single samples."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from typing import Any

from vsacli.compute.tracing.program import Program
from vsacli.compute.tracing.python_text import function_text

NumberFunction = Callable[[Sequence[float]], list[float]]
"""From the inputs of a program to its outputs.

Raises ArithmeticError or ValueError where Python has an error in place of NaN or infinity."""

_FUNCTIONS: dict[str, Any] = {
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
"""What NumPy's functions are on plain numbers."""


def number_function(program: Program) -> NumberFunction:
    """A program on plain numbers.

    Raises:
        NotImplementedError: it has loops or branches.
    """
    text = function_text(program, "run", {"values": len(program.inputs)})
    names = dict(_FUNCTIONS)
    exec(compile(text, "<traced program>", "exec"), names)
    function: NumberFunction = names["run"]
    return function
