"""Control flow on arrays of symbols: loops, branches, tables and subroutines of a sample, and shared calls.

These are the traced implementations of the functions of `vsacli.compute.control_flow`. The body of a loop or
branch is traced once, and so is a function called several times with arguments of the same form.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from vsacli.compute.control_flow import (
    call_on,
    cell_on,
    look_up_on,
    repeat_on,
    subroutine_on,
    where_needed_on,
)
from vsacli.compute.tracing.array import TracedArray, cells_of, each_entry, trace
from vsacli.compute.tracing.program import Kind, Operand, Program, SelectionTable, Symbol, kind_of
from vsacli.compute.tracing.tape import Tape

Function = Callable[..., Any]

LEAST_OPERATIONS = 15
"""Smallest number of operations with which a subroutine shortens code; passing arguments costs about five."""


@repeat_on.register(TracedArray)
def repeat_traced(
    first: TracedArray, step: Function, state: Sequence[Any], constants: Sequence[Any], limit: int
) -> tuple[TracedArray, ...]:
    """Record `control_flow.repeat`: the step is traced once, and repeated when the program runs."""
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
    """Record `control_flow.where_needed`: the function is traced, and runs where the mask holds."""
    count = len(otherwise)

    def branch(truth: Operand, *entries: Operand) -> Sequence[Operand]:
        if truth is False:
            return entries[:count]
        program = _nested(mask.tape, lambda rows: function(*rows), entries[count:])
        return mask.tape.emit_branch(truth, program, entries[count:], entries[:count])

    return _for_each_entry(branch, mask, [mask, *otherwise, *arguments], count)


@subroutine_on.register(TracedArray)
def subroutine_traced(first: TracedArray, function: Function, arguments: Sequence[Any]) -> tuple[Any, ...]:
    """Record `control_flow.subroutine`: a separate function if the code is to be short."""
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
    """Return the program of a body nested in the program of a tape."""
    return trace(function, list(map(kind_of, entries)), short=tape.short)


@look_up_on.register(TracedArray)
def look_up_traced(index: TracedArray, tables: Sequence[Any]) -> tuple[TracedArray, ...]:
    """Record `control_flow.look_up`."""
    return tuple(
        _taken(index, SelectionTable(tuple(np.asarray(table, dtype=np.float64).tolist()))) for table in tables
    )


@cell_on.register(TracedArray)
def cell_traced(position: Any, count: int) -> Any:
    """Record `cell_of`: the number of edges between cells that the position is not below."""
    return np.searchsorted(np.arange(1, count), position, side="right")


def _taken(index: TracedArray, table: SelectionTable) -> TracedArray:
    tape = index.tape
    return TracedArray(tape, each_entry(lambda cell: tape.emit("take", table, cell), index.cells))


def _for_each_entry(
    emit: Callable[..., Sequence[Operand]], like: TracedArray, arrays: Sequence[Any], count: int
) -> tuple[TracedArray, ...]:
    """Return a loop or branch with `count` results for each entry of arrays."""
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


class _Value(NamedTuple):
    """A symbol: its index among those of the arguments or the result, and its kind."""

    number: int
    kind: Kind


@dataclass(frozen=True)
class _Constant:
    """A constant, and its key, by which 0, 0.0 and False are distinguished."""

    key: Hashable
    value: Any = field(compare=False)


class _ArrayForm(NamedTuple):
    """A traced array, by its shape and the forms of its cells."""

    shape: tuple[int, ...]
    cells: tuple[Any, ...]


class _Several(NamedTuple):
    """A tuple, list or dictionary with the forms of its entries, and the keys of a dictionary."""

    type: type
    keys: tuple[Any, ...]
    entries: tuple[Any, ...]


@call_on.register(TracedArray)
def call_traced(row: TracedArray, function: Function, arguments: Sequence[Any]) -> Any:
    """Record `control_flow.call` on a tape that records calls; otherwise record the function inline."""
    tape = row.tape
    if not tape.calling:
        return function(*arguments)
    given: dict[Symbol, int] = {}
    form = _form(list(arguments), given)
    try:
        called = tape.calls.get((function, form))
    except TypeError:  # an unhashable argument may contain symbols
        return function(*arguments)
    if called is None:
        called = _recorded(function, form, [symbol.kind for symbol in given], short=tape.short)
        tape.calls[function, form] = called
    arguments = list(given)
    items = iter(tape.emit_call(called.body, arguments))
    values = [next(items) if place is None else arguments[place] for place in called.returned]
    return _made(called.result, tape, values)


class _Called(NamedTuple):
    """A function that has been called.

    Attributes:
        body: Program of the body.
        result: Form of its result.
        returned: For each value in the result, the input that it is, or None for an output of the body.
    """

    body: Program
    result: Any
    returned: tuple[int | None, ...]


def _recorded(function: Function, form: Any, kinds: Sequence[Kind], *, short: bool) -> _Called:
    """Return the program of a function for arguments of a form."""
    tape = Tape(short=short)
    inputs = {tape.input(kind): number for number, kind in enumerate(kinds)}
    found: dict[Symbol, int] = {}
    result = _form(function(*_made(form, tape, list(inputs))), found)
    body = tape.program([symbol for symbol in found if symbol not in inputs])
    return _Called(body, result, tuple(map(inputs.get, found)))


def _form(tree: Any, found: dict[Symbol, int]) -> Any:
    """Return the form of arguments or a result without its symbols, which are collected."""
    if isinstance(tree, TracedArray):
        return _ArrayForm(tree.shape, tuple(_form(cell, found) for cell in tree.cells.flat))
    if isinstance(tree, Symbol):
        return _Value(found.setdefault(tree, len(found)), tree.kind)
    if isinstance(tree, dict):
        return _Several(dict, tuple(tree), tuple(_form(entry, found) for entry in tree.values()))
    if isinstance(tree, tuple | list):
        return _Several(type(tree), (), tuple(_form(entry, found) for entry in tree))
    return _Constant(_key(tree), tree)


def _key(constant: Any) -> Hashable:
    if isinstance(constant, np.ndarray):
        return "array", constant.shape, constant.dtype.str, constant.tobytes()
    if isinstance(constant, float | int):
        return type(constant), repr(constant)
    return type(constant), constant


def _made(form: Any, tape: Tape, values: Sequence[Operand]) -> Any:
    """Return arguments or a result of a form, with values on a tape."""
    if isinstance(form, _Value):
        return values[form.number]
    if isinstance(form, _Constant):
        return form.value
    if isinstance(form, _ArrayForm):
        cells = np.empty(len(form.cells), dtype=object)
        cells[:] = [_made(cell, tape, values) for cell in form.cells]
        return TracedArray(tape, cells.reshape(form.shape))
    entries: Iterator[Any] = (_made(entry, tape, values) for entry in form.entries)
    if form.type is dict:
        return dict(zip(form.keys, entries, strict=True))
    return form.type(*entries) if hasattr(form.type, "_fields") else form.type(entries)
