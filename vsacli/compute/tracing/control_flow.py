"""Loops, branches and tables of single samples, on arrays of symbols and constants."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from vsacli.compute.control_flow import branching, finding_cell, looking_up, repeating
from vsacli.compute.tracing.array import TracedArray, cells_of
from vsacli.compute.tracing.dead_code import Listing
from vsacli.compute.tracing.operations import kind_of
from vsacli.compute.tracing.symbol import Operand, Symbol, Table
from vsacli.compute.tracing.tape import record
from vsacli.compute.tracing.ufuncs import each

Function = Callable[..., Any]


@repeating.register(TracedArray)
def repeat_traced(
    first: TracedArray, step: Function, state: Sequence[Any], constants: Sequence[Any], limit: int
) -> tuple[TracedArray, ...]:
    """`vsacli.compute.control_flow.repeat`: the step is recorded once, and repeated when the program runs."""
    tape, count = first.tape, len(state)

    def body(symbols: list[Symbol]) -> Sequence[Operand]:
        rows = _rows(symbols)
        following, done = step(tuple(rows[:count]), tuple(rows[count:]))
        return _entries(*following, done)

    def one(*entries: Operand) -> Sequence[Operand]:
        listing = record(body, list(map(kind_of, entries)))
        return tape.record_loop(listing, limit, entries[:count], entries[count:])

    return _each(one, first, [*state, *constants], count)


@branching.register(TracedArray)
def branch_traced(
    mask: TracedArray, function: Function, arguments: Sequence[Any], otherwise: Sequence[Any]
) -> tuple[TracedArray, ...]:
    """`vsacli.compute.control_flow.where_needed`: the function is recorded, and runs where the mask holds."""
    tape, count = mask.tape, len(otherwise)

    def body(symbols: list[Symbol]) -> Sequence[Operand]:
        return _entries(*function(*_rows(symbols)))

    def one(truth: Operand, *entries: Operand) -> Sequence[Operand]:
        if truth is False:
            return entries[:count]
        listing: Listing = record(body, list(map(kind_of, entries[count:])))
        return tape.record_branch(truth, listing, entries[count:], entries[:count])

    return _each(one, mask, [mask, *otherwise, *arguments], count)


@looking_up.register(TracedArray)
def look_up_traced(index: TracedArray, tables: Sequence[Any]) -> tuple[TracedArray, ...]:
    """`vsacli.compute.control_flow.look_up`."""
    return tuple(
        _taken(index, Table(tuple(np.asarray(table, dtype=np.float64).tolist()))) for table in tables
    )


@finding_cell.register(TracedArray)
def find_cell_traced(position: Any, count: int) -> Any:
    """`cell_of`: as many of the edges between the cells as the position is not below."""
    return np.searchsorted(np.arange(1, count), position, side="right")


def _taken(index: TracedArray, table: Table) -> TracedArray:
    return TracedArray(index.tape, each(lambda cell: index.tape.record("take", table, cell), index.cells))


def _rows(symbols: Sequence[Symbol]) -> list[TracedArray]:
    return [TracedArray(symbol.tape, [symbol]) for symbol in symbols]


def _entries(*arrays: Any) -> list[Operand]:
    return [cells_of(array).item() for array in arrays]


def _each(
    one: Callable[..., Sequence[Operand]], like: TracedArray, arrays: Sequence[Any], count: int
) -> tuple[TracedArray, ...]:
    """A function with `count` results for each entry of arrays."""
    spread = np.broadcast_arrays(*map(cells_of, arrays), subok=False)
    results: Iterator[Sequence[Operand]] = (
        one(*entries) for entries in zip(*(cells.flat for cells in spread), strict=True)
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
