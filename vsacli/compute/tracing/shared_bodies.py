"""Sharing: bodies of calls that differ in nothing but constants become one, which is given the constants."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from vsacli.compute.tracing.program import NESTED, Call, Kind, Program, Symbol, kinds_of_operands

Place = tuple[int, ...]
"""Where a constant stands in a program: numbers of the operation and of the operand; or, in a loop or branch,
number of that operation, and the place in its body."""

Constants = dict[Place, float]


class _Body(NamedTuple):
    """The body of a call: all of it but its real constants, and these."""

    shape: Hashable
    constants: Constants


class _Common(NamedTuple):
    """One body for several calls, and where in theirs the constants stand that it is given."""

    body: Program
    places: list[Place]


def with_shared_bodies(program: Program) -> Program:
    """The program with calls of fewer bodies: constants in which alike ones differ become arguments."""
    calls: list[Call] = [symbol.operands[0] for symbol in program.operations if symbol.operation == "call"]
    programs = {id(call.body): call.body for call in calls}
    bodies = {identity: _read(body) for identity, body in programs.items()}
    alike: dict[Hashable, list[int]] = defaultdict(list)
    for identity, body in bodies.items():
        alike[body.shape].append(identity)
    common = {
        shape: _common(programs[group[0]], [bodies[identity].constants for identity in group])
        for shape, group in alike.items()
    }

    def shared(symbol: Symbol) -> Symbol:
        if symbol.operation != "call":
            return symbol
        (body, numbers), *given = symbol.operands
        shape, constants = bodies[id(body)]
        new, places = common[shape]
        return symbol.with_operands([Call(new, numbers), *given, *(constants[place] for place in places)])

    return program._replace(operations=tuple(map(shared, program.operations)))


def _read(program: Program) -> _Body:
    number = {symbol.index: at for at, symbol in enumerate((*program.inputs, *program.operations))}
    constants: Constants = {}
    operations = tuple(
        (symbol.operation, symbol.kind, *_parts(symbol, at, number, constants))
        for at, symbol in enumerate(program.operations)
    )
    outputs = tuple(_part(output, number) for output in program.outputs)
    return _Body((tuple(symbol.kind for symbol in program.inputs), operations, outputs), constants)


def _parts(symbol: Symbol, at: int, number: Mapping[int, int], constants: Constants) -> Iterator[Hashable]:
    """What the operands of an operation are but for real constants, which are noted."""
    for place, (operand, kind) in enumerate(zip(symbol.operands, kinds_of_operands(symbol), strict=True)):
        if place == 0 and symbol.operation in NESTED:
            inner = _read(operand.body)
            constants.update({(at, *deeper): constant for deeper, constant in inner.constants.items()})
            yield inner.shape, operand[1:]
        elif kind is Kind.REAL and isinstance(operand, float | int):
            constants[at, place] = float(operand)
            yield None
        else:
            yield _part(operand, number)


def _part(operand: Any, number: Mapping[int, int]) -> Hashable:
    """The number of a value; else what is fixed, numbers to the digit."""
    if isinstance(operand, Symbol):
        return number[operand.index]
    return (type(operand), repr(operand)) if isinstance(operand, float | int) else operand


def _common(program: Program, of_bodies: Sequence[Constants]) -> _Common:
    """The body for several that are as this one but for constants; which stay where all have the same."""
    first: dict[tuple[str, ...], Place] = {}
    same: dict[Place, Place] = {}
    for place in of_bodies[0]:
        values = tuple(repr(constants[place]) for constants in of_bodies)
        if len(set(values)) > 1:
            same[place] = first.setdefault(values, place)
    number = {place: at for at, place in enumerate(first.values())}
    return _Common(_opened(program, {place: number[other] for place, other in same.items()}), list(number))


def _opened(program: Program, parameters: Mapping[Place, int]) -> Program:
    """A program that is given the constants in some places: those of the same number in one input."""
    if not parameters:
        return program
    values = [*program.inputs, *program.operations]
    free = 1 + max(symbol.index for symbol in values)
    inputs = {
        number: Symbol(values[0].tape, free + at, "input", (), Kind.REAL)
        for at, number in enumerate(sorted(set(parameters.values())))
    }
    of_operations: dict[int, dict[Place, int]] = defaultdict(dict)
    for (at, *place), number in parameters.items():
        of_operations[at][tuple(place)] = number
    operations = list(program.operations)
    for at, places in of_operations.items():
        operations[at] = _given(operations[at], places, inputs)
    return Program((*program.inputs, *inputs.values()), tuple(operations), program.outputs)


def _given(symbol: Symbol, places: Mapping[Place, int], inputs: Mapping[int, Symbol]) -> Symbol:
    """An operation with values in place of constants among its operands, or in its body."""
    operands: list[Any] = list(symbol.operands)
    deeper = {place: number for place, number in places.items() if len(place) > 1}
    for place, number in places.items():
        if len(place) == 1:
            operands[place[0]] = inputs[number]
    if deeper:
        operands[0] = operands[0]._replace(body=_opened(operands[0].body, deeper))
        operands += [inputs[number] for number in sorted(set(deeper.values()))]
    return symbol.with_operands(operands)
