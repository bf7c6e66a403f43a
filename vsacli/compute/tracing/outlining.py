"""Outlining: what a program does between its calls becomes calls, too, of bodies of bounded size."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import count
from typing import NamedTuple

from vsacli.compute.tracing.program import Call, Program, Symbol

MOST_OUTLINED = 500
"""Operations in a row that become one body: the time of a compiler grows with the square of a function's."""


class _Run(NamedTuple):
    """Operations in a row."""

    operations: list[Symbol]


def with_outlined_runs(program: Program) -> Program:
    """The program with nothing but calls and items of these."""
    parts = list(_parts(program.operations))
    last_part = {
        operand.index: number
        for number, part in enumerate(parts)
        for symbol in (part.operations if isinstance(part, _Run) else [part])
        for operand in symbol.operands
        if isinstance(operand, Symbol)
    }
    last_part |= {output.index: len(parts) for output in program.outputs if isinstance(output, Symbol)}
    free = count(1 + max((symbol.index for symbol in program.operations), default=0))
    operations: list[Symbol] = []
    for number, part in enumerate(parts):
        if isinstance(part, _Run):
            results = [symbol for symbol in part.operations if last_part.get(symbol.index, 0) > number]
            operations += _called(part.operations, results, next(free))
        else:
            operations.append(part)
    return program._replace(operations=tuple(operations))


def _parts(operations: Sequence[Symbol]) -> Iterator[Symbol | _Run]:
    """Calls and their items as they are, and what lies between in runs."""
    run: list[Symbol] = []
    for symbol in operations:
        of_call = symbol.operation == "call" or _is_item_of_call(symbol)
        if run and (of_call or (len(run) >= MOST_OUTLINED and symbol.operation != "item")):
            yield _Run(run)
            run = []
        if of_call:
            yield symbol
        else:
            run.append(symbol)
    if run:
        yield _Run(run)


def _is_item_of_call(symbol: Symbol) -> bool:
    return symbol.operation == "item" and symbol.operands[0].operation == "call"


def _called(operations: Sequence[Symbol], results: Sequence[Symbol], index: int) -> list[Symbol]:
    """A call of operations, and the results that are read beyond, which keep their numbers."""
    own = {symbol.index for symbol in operations}
    given = {
        operand.index: operand
        for symbol in operations
        for operand in symbol.operands
        if isinstance(operand, Symbol) and operand.index not in own
    }
    inputs = {
        number: Symbol(operand.tape, number, "input", (), operand.kind) for number, operand in given.items()
    }
    inner = [
        symbol.with_operands(
            [
                inputs.get(operand.index, operand) if isinstance(operand, Symbol) else operand
                for operand in symbol.operands
            ]
        )
        for symbol in operations
    ]
    body = Program(tuple(inputs.values()), tuple(inner), tuple(results))
    first = operations[0]
    call = Symbol(
        first.tape, index, "call", (Call(body, tuple(range(len(results)))), *given.values()), first.kind
    )
    items = [
        Symbol(first.tape, symbol.index, "item", (call, number), symbol.kind)
        for number, symbol in enumerate(results)
    ]
    return [call, *items]
