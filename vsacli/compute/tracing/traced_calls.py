"""Calls of functions on arrays of symbols: what is called alike is traced once."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from vsacli.compute.control_flow import call_on
from vsacli.compute.tracing.array import TracedArray
from vsacli.compute.tracing.program import Kind, Operand, Program, Symbol
from vsacli.compute.tracing.tape import Tape

Function = Callable[..., Any]


class _Value(NamedTuple):
    """A symbol: the how manieth of those in arguments or a result, and its kind."""

    number: int
    kind: Kind


@dataclass(frozen=True)
class _Constant:
    """Anything that is no symbol, and what tells it apart: 0 and 0.0 and False are three constants."""

    key: Hashable
    value: Any = field(compare=False)


class _Array(NamedTuple):
    """A traced array, by its shape and the forms of its cells."""

    shape: tuple[int, ...]
    cells: tuple[Any, ...]


class _Several(NamedTuple):
    """A tuple, list or dictionary; of a dictionary the keys."""

    type: type
    keys: tuple[Any, ...]
    entries: tuple[Any, ...]


@call_on.register(TracedArray)
def call_traced(row: TracedArray, function: Function, arguments: Sequence[Any]) -> Any:
    """`vsacli.compute.control_flow.call`, on a tape that records calls; else what is called is recorded."""
    tape = row.tape
    if not tape.calling:
        return function(*arguments)
    given: dict[Symbol, int] = {}
    form = _form(list(arguments), given)
    try:
        called = tape.calls.get((function, form))
    except TypeError:  # what cannot be hashed may hold symbols
        return function(*arguments)
    if called is None:
        called = _recorded(function, form, [symbol.kind for symbol in given], short=tape.short)
        tape.calls[function, form] = called
    arguments = list(given)
    items = iter(tape.emit_call(called.body, arguments))
    values = [next(items) if place is None else arguments[place] for place in called.returned]
    return _made(called.result, tape, values)


class _Called(NamedTuple):
    """What has been called.

    Attributes:
        body: its program.
        result: the form of what it returns.
        returned: of each value in that, which of the inputs it is; None if it is an output of the body.
    """

    body: Program
    result: Any
    returned: tuple[int | None, ...]


def _recorded(function: Function, form: Any, kinds: Sequence[Kind], *, short: bool) -> _Called:
    """What a function does with arguments of a form."""
    tape = Tape(short=short)
    inputs = {tape.input(kind): number for number, kind in enumerate(kinds)}
    found: dict[Symbol, int] = {}
    result = _form(function(*_made(form, tape, list(inputs))), found)
    body = tape.program([symbol for symbol in found if symbol not in inputs])
    return _Called(body, result, tuple(map(inputs.get, found)))


def _form(tree: Any, found: dict[Symbol, int]) -> Any:
    """What arguments or a result are but for their symbols, which are found and numbered."""
    if isinstance(tree, TracedArray):
        return _Array(tree.shape, tuple(_form(cell, found) for cell in tree.cells.flat))
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
    """Arguments or a result of a form, with values on a tape."""
    if isinstance(form, _Value):
        return values[form.number]
    if isinstance(form, _Constant):
        return form.value
    if isinstance(form, _Array):
        cells = np.empty(len(form.cells), dtype=object)
        cells[:] = [_made(cell, tape, values) for cell in form.cells]
        return TracedArray(tape, cells.reshape(form.shape))
    entries: Iterator[Any] = (_made(entry, tape, values) for entry in form.entries)
    if form.type is dict:
        return dict(zip(form.keys, entries, strict=True))
    return form.type(*entries) if hasattr(form.type, "_fields") else form.type(entries)
