"""Worst-case cost of a generated function: operations and constant tables, counted in its program."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from vsacli.compute.tracing import Program, Symbol
from vsacli.compute.tracing.c_code import Tables
from vsacli.compute.tracing.program import FUNCTIONS, Branch, Call, Loop, SelectionTable, Subroutine
from vsacli.control.codegen.scalar import BYTES, scalar_dialect

INDEX_BYTES = 4
"""Bytes of an int."""


@dataclass(frozen=True)
class Cost:
    """Operations of one call if every branch is entered and every loop runs to its bound.

    Attributes:
        operations: number of additions, products, comparisons etc.; a call of math.h counts as one.
        functions: number of calls of math.h functions, including `fabs` and `sqrt`.
        loops: number of loops; one inside another counts once.
    """

    operations: int
    functions: int
    loops: int

    def __add__(self, other: Cost) -> Cost:
        return Cost(
            self.operations + other.operations, self.functions + other.functions, self.loops + other.loops
        )


def worst_cost(program: Program) -> Cost:
    """Return the worst-case cost of a call."""
    return sum(map(_operation_cost, program.operations), Cost(0, 0, 0))


def table_bytes(programs: Iterable[Program], precision: str) -> int:
    """Return the bytes of all constant tables, including those whose rows are passed to calls."""
    programs = list(programs)
    tables = Tables(programs, scalar_dialect(precision).array_type)
    call_bytes = sum(_call_bytes(program, precision) for program in programs)
    return call_bytes + sum(BYTES[array.type] * len(array.values) for array in tables.arrays)


def _call_bytes(program: Program, precision: str) -> int:
    """Return the bytes of constants passed to calls, and of the indices of their inputs and outputs."""
    calls = [symbol.operands for symbol in program.operations if symbol.operation == "call"]
    index_count = sum(len(call.indices) for call, *_ in calls)
    index_count += sum(isinstance(operand, Symbol) for _, *operands in calls for operand in operands)
    constant_count = sum(not isinstance(operand, Symbol) for _, *operands in calls for operand in operands)
    return BYTES[precision] * constant_count + INDEX_BYTES * index_count


def _operation_cost(symbol: Symbol) -> Cost:
    nested = symbol.operands[0] if symbol.operands else None
    if isinstance(nested, Loop):
        body = worst_cost(nested.body)
        return Cost(nested.limit * body.operations, nested.limit * body.functions, 1 + body.loops)
    if isinstance(nested, Branch | Call | Subroutine):
        return worst_cost(nested.body)
    if symbol.operation == "item":
        return Cost(0, 0, 0)
    if symbol.operation == "searchsorted" and isinstance(nested, SelectionTable):
        return Cost(math.ceil(math.log2(len(nested.values) + 1)), 0, 1)
    return Cost(1, int(symbol.operation in FUNCTIONS), 0)
