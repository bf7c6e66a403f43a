"""Programs that consist of calls, for long chains: the passes that make them, and the places of values.

Outlining turns the operations between calls into calls, with bodies of bounded size, since the time of a
compiler grows with the square of a function's length. Sharing merges bodies that differ only in constants,
which become arguments. A `Workspace` assigns places to values while they are live, as a compiler allocates
registers.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from itertools import count
from typing import Any, NamedTuple

from vsacli.compute.tracing.program import NESTED, Call, Kind, Program, Symbol, kinds_of_operands

MOST_OUTLINED = 500
"""Largest number of operations of an outlined body; the compiler's time grows with its square."""


class _OperationRun(NamedTuple):
    """Consecutive operations."""

    operations: list[Symbol]


def with_outlined_runs(program: Program) -> Program:
    """Return the program with all operations between calls turned into calls."""
    parts = list(_calls_and_runs(program.operations))
    last_part = {
        operand.index: position
        for position, part in enumerate(parts)
        for symbol in (part.operations if isinstance(part, _OperationRun) else [part])
        for operand in symbol.operands
        if isinstance(operand, Symbol)
    }
    last_part |= {output.index: len(parts) for output in program.outputs if isinstance(output, Symbol)}
    free_indices = count(1 + max((symbol.index for symbol in program.operations), default=0))
    operations: list[Symbol] = []
    for position, part in enumerate(parts):
        if isinstance(part, _OperationRun):
            results = [symbol for symbol in part.operations if last_part.get(symbol.index, 0) > position]
            operations += _outlined_call(part.operations, results, next(free_indices))
        else:
            operations.append(part)
    return program._replace(operations=tuple(operations))


def _calls_and_runs(operations: Sequence[Symbol]) -> Iterator[Symbol | _OperationRun]:
    """Yield calls and their items unchanged, and the operations between them in runs."""
    run: list[Symbol] = []
    for symbol in operations:
        of_call = symbol.operation == "call" or _is_item_of_call(symbol)
        if run and (of_call or (len(run) >= MOST_OUTLINED and symbol.operation != "item")):
            yield _OperationRun(run)
            run = []
        if of_call:
            yield symbol
        else:
            run.append(symbol)
    if run:
        yield _OperationRun(run)


def _is_item_of_call(symbol: Symbol) -> bool:
    return symbol.operation == "item" and symbol.operands[0].operation == "call"


def _outlined_call(operations: Sequence[Symbol], results: Sequence[Symbol], index: int) -> list[Symbol]:
    """Return a call of operations, and the results that are read after it, which keep their numbers."""
    own_indices = {symbol.index for symbol in operations}
    arguments = {
        operand.index: operand
        for symbol in operations
        for operand in symbol.operands
        if isinstance(operand, Symbol) and operand.index not in own_indices
    }
    inputs = {
        position: Symbol(operand.tape, position, "input", (), operand.kind)
        for position, operand in arguments.items()
    }
    body_operations = [
        symbol.with_operands(
            [
                inputs.get(operand.index, operand) if isinstance(operand, Symbol) else operand
                for operand in symbol.operands
            ]
        )
        for symbol in operations
    ]
    body = Program(tuple(inputs.values()), tuple(body_operations), tuple(results))
    first = operations[0]
    call = Symbol(
        first.tape, index, "call", (Call(body, tuple(range(len(results)))), *arguments.values()), first.kind
    )
    items = [
        Symbol(first.tape, symbol.index, "item", (call, position), symbol.kind)
        for position, symbol in enumerate(results)
    ]
    return [call, *items]


ConstantPath = tuple[int, ...]
"""Place of a constant in a program: indices of operation and operand; in a loop or conditional, the index of
that operation and the place in its body."""

Constants = dict[ConstantPath, float]


class _Body(NamedTuple):
    """Body of a call: its structure without real constants, and the constants."""

    shape: Hashable
    constants: Constants


class _CommonBody(NamedTuple):
    """Common body of several calls, and the places in their own bodies of constants that became arguments."""

    body: Program
    places: list[ConstantPath]


class SharedBody(NamedTuple):
    """A program that similar ones share, and the constants of one of them, its last inputs."""

    program: Program
    constants: list[float]


def with_shared_bodies(program: Program) -> Program:
    """Return the program with fewer bodies: constants in which similar bodies differ become arguments."""
    calls: list[Call] = [symbol.operands[0] for symbol in program.operations if symbol.operation == "call"]
    programs = {id(call.body): call.body for call in calls}
    shared = dict(zip(programs, share_bodies(list(programs.values())), strict=True))

    def of_shared_body(symbol: Symbol) -> Symbol:
        if symbol.operation != "call":
            return symbol
        (body, numbers), *arguments = symbol.operands
        common, constants = shared[id(body)]
        return symbol.with_operands([Call(common, numbers), *arguments, *constants])

    return program._replace(operations=tuple(map(of_shared_body, program.operations)))


def share_bodies(programs: Sequence[Program]) -> list[SharedBody]:
    """Return the body of each program, the same object for those that differ only in constants."""
    bodies = list(map(_read_body, programs))
    groups: dict[Hashable, list[int]] = defaultdict(list)
    for index, body in enumerate(bodies):
        groups[body.shape].append(index)
    shared: dict[int, SharedBody] = {}
    for members in groups.values():
        common, paths = _common_body(programs[members[0]], [bodies[index].constants for index in members])
        for index in members:
            shared[index] = SharedBody(common, [bodies[index].constants[path] for path in paths])
    return [shared[index] for index in range(len(programs))]


def _read_body(program: Program) -> _Body:
    positions = {
        symbol.index: position for position, symbol in enumerate((*program.inputs, *program.operations))
    }
    constants: Constants = {}
    operations = tuple(
        (symbol.operation, symbol.kind, *_operand_structures(symbol, position, positions, constants))
        for position, symbol in enumerate(program.operations)
    )
    outputs = tuple(_operand_structure(output, positions) for output in program.outputs)
    return _Body((tuple(symbol.kind for symbol in program.inputs), operations, outputs), constants)


def _operand_structures(
    symbol: Symbol, position: int, positions: Mapping[int, int], constants: Constants
) -> Iterator[Hashable]:
    """Yield the structure of an operation's operands, and collect their real constants."""
    for operand_index, (operand, kind) in enumerate(
        zip(symbol.operands, kinds_of_operands(symbol), strict=True)
    ):
        if operand_index == 0 and symbol.operation in NESTED:
            nested = _read_body(operand.body)
            constants.update(
                {(position, *inner_path): constant for inner_path, constant in nested.constants.items()}
            )
            yield nested.shape, operand[1:]
        elif kind is Kind.REAL and isinstance(operand, float | int):
            constants[position, operand_index] = float(operand)
            yield None
        else:
            yield _operand_structure(operand, positions)


def _operand_structure(operand: Any, positions: Mapping[int, int]) -> Hashable:
    """Return the number of a value; for a constant its type and digits, for other operands themselves."""
    if isinstance(operand, Symbol):
        return positions[operand.index]
    return (type(operand), repr(operand)) if isinstance(operand, float | int) else operand


def _common_body(program: Program, constants_of_bodies: Sequence[Constants]) -> _CommonBody:
    """Return one body for several that differ only in constants; equal constants stay in the body."""
    first_paths: dict[tuple[str, ...], ConstantPath] = {}
    first_equal: dict[ConstantPath, ConstantPath] = {}
    for path in constants_of_bodies[0]:
        values = tuple(repr(constants[path]) for constants in constants_of_bodies)
        if len(set(values)) > 1:
            first_equal[path] = first_paths.setdefault(values, path)
    input_numbers = {path: position for position, path in enumerate(first_paths.values())}
    return _CommonBody(
        _with_parameters(
            program, {path: input_numbers[first_path] for path, first_path in first_equal.items()}
        ),
        list(input_numbers),
    )


def _with_parameters(program: Program, parameters: Mapping[ConstantPath, int]) -> Program:
    """Return a program with inputs in place of constants; places with equal numbers share an input."""
    if not parameters:
        return program
    values = [*program.inputs, *program.operations]
    free_index = 1 + max(symbol.index for symbol in values)
    inputs = {
        input_number: Symbol(values[0].tape, free_index + position, "input", (), Kind.REAL)
        for position, input_number in enumerate(sorted(set(parameters.values())))
    }
    paths_of_operations: dict[int, dict[ConstantPath, int]] = defaultdict(dict)
    for (position, *path), input_number in parameters.items():
        paths_of_operations[position][tuple(path)] = input_number
    operations = list(program.operations)
    for position, paths in paths_of_operations.items():
        operations[position] = _with_inputs(operations[position], paths, inputs)
    return Program((*program.inputs, *inputs.values()), tuple(operations), program.outputs)


def _with_inputs(symbol: Symbol, paths: Mapping[ConstantPath, int], inputs: Mapping[int, Symbol]) -> Symbol:
    """Return an operation with values in place of constants among its operands, or in its body."""
    operands: list[Any] = list(symbol.operands)
    nested_paths = {path: input_number for path, input_number in paths.items() if len(path) > 1}
    for path, input_number in paths.items():
        if len(path) == 1:
            operands[path[0]] = inputs[input_number]
    if nested_paths:
        operands[0] = operands[0]._replace(body=_with_parameters(operands[0].body, nested_paths))
        operands += [inputs[input_number] for input_number in sorted(set(nested_paths.values()))]
    return symbol.with_operands(operands)


class Workspace:
    """Places of values; results of a call never share a place with its arguments.

    Args:
        program: Program that consists of calls and their items.
        by_kind: Whether each kind of value has separate places; otherwise all places are real.

    Attributes:
        slot: Place of each value among those of its kind, by index; inputs come first, in their order.
        counts: Number of places for each kind.
    """

    def __init__(self, program: Program, *, by_kind: bool = False) -> None:
        self._by_kind = by_kind
        self.slot = {symbol.index: slot for slot, symbol in enumerate(program.inputs)}
        self.counts: dict[Kind, int] = defaultdict(int, {Kind.REAL: len(program.inputs)})
        self._free: dict[Kind, list[int]] = defaultdict(list)
        self._items: dict[int, list[Symbol]] = defaultdict(list)
        self._last_use: dict[int, int] = {}
        for symbol in program.operations:
            if symbol.operation == "item":
                self._items[symbol.operands[0].index].append(symbol)
            else:
                self._last_use |= {value.index: symbol.index for value in values_of(symbol)}
        for live in (*program.inputs, *program.outputs):
            if isinstance(live, Symbol):
                self._last_use.pop(live.index, None)

    def results(self, call: Symbol) -> list[Symbol]:
        """Return the results of the next call, in the order of its body's outputs, and assign places."""
        output_order = {
            output_index: position for position, output_index in enumerate(call.operands[0].indices)
        }
        items = sorted(self._items[call.index], key=lambda item: output_order[item.operands[1]])
        for item in items:
            self._allocate(item)
        for value in {value.index: value for value in values_of(call)}.values():
            if self._last_use.get(value.index) == call.index:
                self._free[self._pool(value)].append(self.slot[value.index])
        return items

    def _allocate(self, value: Symbol) -> None:
        pool = self._pool(value)
        if not self._free[pool]:
            self._free[pool].append(self.counts[pool])
            self.counts[pool] += 1
        self.slot[value.index] = self._free[pool].pop()

    def _pool(self, value: Symbol) -> Kind:
        return value.kind if self._by_kind else Kind.REAL


def values_of(symbol: Symbol) -> Iterator[Symbol]:
    """Yield the operands of an operation that are no constants."""
    return (operand for operand in symbol.operands if isinstance(operand, Symbol))
