"""Tracing: a kernel that runs on symbols instead of numbers records a program, which becomes Python or C.

`array` has the symbols' arrays, `tape` and `program` the recorded operations, `simplification` the passes on
them. `python_functions`, `row_functions` and `c_code` translate programs.
"""

from vsacli.compute.tracing import traced_control_flow  # noqa: F401  (registers the control flow of symbols)
from vsacli.compute.tracing.array import TracedArray, cells_of, trace, trace_by_size
from vsacli.compute.tracing.program import Kind, Operand, Program, Symbol, is_of_calls
from vsacli.compute.tracing.tape import MOST_RECORDED, Tape, TooLongError

__all__ = [
    "MOST_RECORDED",
    "Kind",
    "Operand",
    "Program",
    "Symbol",
    "Tape",
    "TooLongError",
    "TracedArray",
    "cells_of",
    "is_of_calls",
    "trace",
    "trace_by_size",
]
