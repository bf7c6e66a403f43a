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
    state_size = len(state)

    def body(rows: Sequence[Any]) -> Sequence[Any]:
        next_state, done = step(tuple(rows[:state_size]), tuple(rows[state_size:]))
        return [*next_state, done]

    def loop(*operands: Operand) -> Sequence[Operand]:
        program = _nested_program(first.tape, body, operands)
        return first.tape.emit_loop(program, limit, operands[:state_size], operands[state_size:])

    return _for_each_entry(loop, first, [*state, *constants], state_size)


@where_needed_on.register(TracedArray)
def where_needed_traced(
    mask: TracedArray, function: Function, arguments: Sequence[Any], otherwise: Sequence[Any]
) -> tuple[TracedArray, ...]:
    """Record `control_flow.where_needed`: the function is traced, and runs where the mask holds."""
    output_count = len(otherwise)

    def branch(truth: Operand, *entries: Operand) -> Sequence[Operand]:
        if truth is False:
            return entries[:output_count]
        program = _nested_program(mask.tape, lambda rows: function(*rows), entries[output_count:])
        return mask.tape.emit_branch(truth, program, entries[output_count:], entries[:output_count])

    return _for_each_entry(branch, mask, [mask, *otherwise, *arguments], output_count)


@subroutine_on.register(TracedArray)
def subroutine_traced(first: TracedArray, function: Function, arguments: Sequence[Any]) -> tuple[Any, ...]:
    """Record `control_flow.subroutine`: a separate function if the code is to be short."""
    if not first.tape.short:
        return tuple(function(*arguments))
    entries: list[Any] = [cells_of(argument).flat[0] for argument in arguments]
    body = _nested_program(first.tape, lambda rows: function(*rows), entries)
    if len(body.operations) < LEAST_OPERATIONS:
        return tuple(function(*arguments))
    return _for_each_entry(
        lambda *entries: first.tape.emit_subroutine(body, entries), first, arguments, len(body.outputs)
    )


def _nested_program(
    tape: Tape, function: Callable[[Sequence[Any]], Sequence[Any]], entries: Sequence[Operand]
) -> Program:
    """Return the program of a body nested in the program of a tape."""
    return trace(function, list(map(kind_of, entries)), short=tape.short)


@look_up_on.register(TracedArray)
def look_up_traced(index: TracedArray, tables: Sequence[Any]) -> tuple[TracedArray, ...]:
    """Record `control_flow.look_up`."""
    return tuple(
        _taken_entries(index, SelectionTable(tuple(np.asarray(table, dtype=np.float64).tolist())))
        for table in tables
    )


@cell_on.register(TracedArray)
def cell_traced(position: Any, count: int) -> Any:
    """Record `cell_of`: the number of edges between cells that the position is not below."""
    return np.searchsorted(np.arange(1, count), position, side="right")


def _taken_entries(index: TracedArray, table: SelectionTable) -> TracedArray:
    tape = index.tape
    return TracedArray(tape, each_entry(lambda cell: tape.emit("take", table, cell), index.cells))


def _for_each_entry(
    emit: Callable[..., Sequence[Operand]], like: TracedArray, arrays: Sequence[Any], count: int
) -> tuple[TracedArray, ...]:
    """Return a loop or branch with `count` results for each entry of arrays."""
    broadcast = np.broadcast_arrays(*map(cells_of, arrays), subok=False)
    results: Iterator[Sequence[Operand]] = (
        emit(*entries) for entries in zip(*(cells.flat for cells in broadcast), strict=True)
    )
    columns = zip(*results, strict=True)
    shape = broadcast[0].shape
    traced = tuple(TracedArray(like.tape, _reshaped_cells(column, shape)) for column in columns)
    assert len(traced) == count
    return traced


def _reshaped_cells(entries: Sequence[Operand], shape: tuple[int, ...]) -> Any:
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


class _Collection(NamedTuple):
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
    symbol_numbers: dict[Symbol, int] = {}
    form = _form_of(list(arguments), symbol_numbers)
    try:
        recorded = tape.calls.get((function, form))
    except TypeError:  # an unhashable argument may contain symbols
        return function(*arguments)
    if recorded is None:
        recorded = _record_call(function, form, [symbol.kind for symbol in symbol_numbers], short=tape.short)
        tape.calls[function, form] = recorded
    arguments = list(symbol_numbers)
    outputs = iter(tape.emit_call(recorded.body, arguments))
    values = [
        next(outputs) if input_number is None else arguments[input_number]
        for input_number in recorded.returned
    ]
    return _rebuild_form(recorded.result, tape, values)


class _RecordedCall(NamedTuple):
    """A function that has been called.

    Attributes:
        body: Program of the body.
        result: Form of its result.
        returned: For each value in the result, the input that it is, or None for an output of the body.
    """

    body: Program
    result: Any
    returned: tuple[int | None, ...]


def _record_call(function: Function, form: Any, kinds: Sequence[Kind], *, short: bool) -> _RecordedCall:
    """Return the program of a function for arguments of a form."""
    tape = Tape(short=short)
    inputs = {tape.input(kind): number for number, kind in enumerate(kinds)}
    result_symbols: dict[Symbol, int] = {}
    result = _form_of(function(*_rebuild_form(form, tape, list(inputs))), result_symbols)
    body = tape.program([symbol for symbol in result_symbols if symbol not in inputs])
    return _RecordedCall(body, result, tuple(map(inputs.get, result_symbols)))


def _form_of(value: Any, symbol_numbers: dict[Symbol, int]) -> Any:
    """Return the form of arguments or a result without its symbols, which are collected."""
    if isinstance(value, TracedArray):
        return _ArrayForm(value.shape, tuple(_form_of(cell, symbol_numbers) for cell in value.cells.flat))
    if isinstance(value, Symbol):
        return _Value(symbol_numbers.setdefault(value, len(symbol_numbers)), value.kind)
    if isinstance(value, dict):
        return _Collection(
            dict, tuple(value), tuple(_form_of(entry, symbol_numbers) for entry in value.values())
        )
    if isinstance(value, tuple | list):
        return _Collection(type(value), (), tuple(_form_of(entry, symbol_numbers) for entry in value))
    return _Constant(_constant_key(value), value)


def _constant_key(constant: Any) -> Hashable:
    if isinstance(constant, np.ndarray):
        return "array", constant.shape, constant.dtype.str, constant.tobytes()
    if isinstance(constant, float | int):
        return type(constant), repr(constant)
    return type(constant), constant


def _rebuild_form(form: Any, tape: Tape, values: Sequence[Operand]) -> Any:
    """Return arguments or a result of a form, with values on a tape."""
    if isinstance(form, _Value):
        return values[form.number]
    if isinstance(form, _Constant):
        return form.value
    if isinstance(form, _ArrayForm):
        cells = np.empty(len(form.cells), dtype=object)
        cells[:] = [_rebuild_form(cell, tape, values) for cell in form.cells]
        return TracedArray(tape, cells.reshape(form.shape))
    entries: Iterator[Any] = (_rebuild_form(entry, tape, values) for entry in form.entries)
    if form.type is dict:
        return dict(zip(form.keys, entries, strict=True))
    return form.type(*entries) if hasattr(form.type, "_fields") else form.type(entries)
