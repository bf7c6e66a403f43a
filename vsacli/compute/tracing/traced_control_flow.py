"""Loops, branches and tables of single samples, on arrays of symbols and constants."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from vsacli.compute.control_flow import cell_on, look_up_on, repeat_on, subroutine_on, where_needed_on
from vsacli.compute.tracing.array import TracedArray, cells_of, trace
from vsacli.compute.tracing.numpy_functions import each_entry
from vsacli.compute.tracing.program import Operand, Program, Table, kind_of
from vsacli.compute.tracing.tape import Tape

Function = Callable[..., Any]

LEAST_OPERATIONS = 15
"""Of a subroutine that makes code shorter: to pass arguments and results takes as much as some five."""


@repeat_on.register(TracedArray)
def repeat_traced(
    first: TracedArray, step: Function, state: Sequence[Any], constants: Sequence[Any], limit: int
) -> tuple[TracedArray, ...]:
    """`vsacli.compute.control_flow.repeat`: the step is traced once, and repeated when the program runs."""
    count = len(state)

    def body(rows: Sequence[Any]) -> Sequence[Any]:
        next_state, done = step(tuple(rows[:count]), tuple(rows[count:]))
        return [*next_state, done]

    def loop(*entries: Operand) -> Sequence[Operand]:
        program = _nested(first.tape, body, entries)
        return first.tape.emit_loop(program, limit, entries[:count], entries[count:])

    return _for_each_entry(loop, first, [*state, *constants], count)


@where_needed_on.register(TracedArray)
def where_needed_traced(
    mask: TracedArray, function: Function, arguments: Sequence[Any], otherwise: Sequence[Any]
) -> tuple[TracedArray, ...]:
    """`vsacli.compute.control_flow.where_needed`: the function is traced, and runs where the mask holds."""
    count = len(otherwise)

    def branch(truth: Operand, *entries: Operand) -> Sequence[Operand]:
        if truth is False:
            return entries[:count]
        program = _nested(mask.tape, lambda rows: function(*rows), entries[count:])
        return mask.tape.emit_branch(truth, program, entries[count:], entries[:count])

    return _for_each_entry(branch, mask, [mask, *otherwise, *arguments], count)


@subroutine_on.register(TracedArray)
def subroutine_traced(first: TracedArray, function: Function, arguments: Sequence[Any]) -> tuple[Any, ...]:
    """`vsacli.compute.control_flow.subroutine`: a function of its own if the code is to be short."""
    if not first.tape.short:
        return tuple(function(*arguments))
    entries: list[Any] = [cells_of(each).flat[0] for each in arguments]
    body = _nested(first.tape, lambda rows: function(*rows), entries)
    if len(body.operations) < LEAST_OPERATIONS:
        return tuple(function(*arguments))
    return _for_each_entry(
        lambda *entries: first.tape.emit_subroutine(body, entries), first, arguments, len(body.outputs)
    )


def _nested(
    tape: Tape, function: Callable[[Sequence[Any]], Sequence[Any]], entries: Sequence[Operand]
) -> Program:
    """The program of a body within one on a tape."""
    return trace(function, list(map(kind_of, entries)), short=tape.short)


@look_up_on.register(TracedArray)
def look_up_traced(index: TracedArray, tables: Sequence[Any]) -> tuple[TracedArray, ...]:
    """`vsacli.compute.control_flow.look_up`."""
    return tuple(
        _taken(index, Table(tuple(np.asarray(table, dtype=np.float64).tolist()))) for table in tables
    )


@cell_on.register(TracedArray)
def cell_traced(position: Any, count: int) -> Any:
    """`cell_of`: as many of the edges between the cells as the position is not below."""
    return np.searchsorted(np.arange(1, count), position, side="right")


def _taken(index: TracedArray, table: Table) -> TracedArray:
    tape = index.tape
    return TracedArray(tape, each_entry(lambda cell: tape.emit("take", table, cell), index.cells))


def _for_each_entry(
    emit: Callable[..., Sequence[Operand]], like: TracedArray, arrays: Sequence[Any], count: int
) -> tuple[TracedArray, ...]:
    """A loop or branch with `count` results for each entry of arrays."""
    spread = np.broadcast_arrays(*map(cells_of, arrays), subok=False)
    results: Iterator[Sequence[Operand]] = (
        emit(*entries) for entries in zip(*(cells.flat for cells in spread), strict=True)
    )
    columns = zip(*results, strict=True)
    shape = spread[0].shape
    made = tuple(TracedArray(like.tape, _shaped(column, shape)) for column in columns)
    assert len(made) == count
    return made


def _shaped(entries: Sequence[Operand], shape: tuple[int, ...]) -> Any:
    cells = np.empty(len(entries), dtype=object)
    cells[:] = entries
    return cells.reshape(shape)
