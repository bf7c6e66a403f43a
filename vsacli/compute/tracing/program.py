"""The intermediate representation: programs of operations on symbols.

Each value is assigned once, and an operation follows its operands. Loops, branches and calls are operations,
too: they contain the program of their body, and operations named "item" return their single results.
"""

from __future__ import annotations

import enum
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeAlias

from vsacli.compute.vector import Scalar


class Kind(enum.Enum):
    """Kind of a value: floating-point number, Boolean, bit field, or index of a table."""

    REAL = enum.auto()
    TRUTH = enum.auto()
    BITS = enum.auto()
    INDEX = enum.auto()


@dataclass(frozen=True)
class SelectionTable:
    """Constants from which an operation selects."""

    values: tuple[float, ...]


class Emitter(Protocol):
    """The receiver of operations on symbols: a tape."""

    def emit(self, operation: str, *operands: Any) -> Operand:
        """Return the result of an operation on symbols and constants."""


class Symbol:
    """An input of a program, or the result of an operation, as a scalar with + - * / cos sin tanh.

    Attributes:
        tape: Tape that contains the operation.
        index: Number of the value on the tape.
        operation: Operation, as for `Tape.emit`; "input" for an input.
        operands: Operands of the operation; a table, or the body of a loop, comes first.
        kind: Kind of the value.
    """

    __slots__ = ("index", "kind", "operands", "operation", "tape")

    def __init__(
        self, tape: Emitter, index: int, operation: str, operands: tuple[Any, ...], kind: Kind
    ) -> None:
        self.tape = tape
        self.index = index
        self.operation = operation
        self.operands = operands
        self.kind = kind

    def with_operands(self, operands: Sequence[Any]) -> Symbol:
        """Return the symbol with other operands."""
        return Symbol(self.tape, self.index, self.operation, tuple(operands), self.kind)

    def __add__(self, other: Scalar) -> Operand:
        return self.tape.emit("add", self, other)

    def __sub__(self, other: Scalar) -> Operand:
        return self.tape.emit("subtract", self, other)

    def __mul__(self, other: Scalar) -> Operand:
        return self.tape.emit("multiply", self, other)

    def __truediv__(self, other: Scalar) -> Operand:
        return self.tape.emit("divide", self, other)

    def __rsub__(self, other: Scalar) -> Operand:
        return self.tape.emit("subtract", other, self)

    def __rtruediv__(self, other: Scalar) -> Operand:
        return self.tape.emit("divide", other, self)

    __radd__ = __add__
    __rmul__ = __mul__

    def __neg__(self) -> Operand:
        return self.tape.emit("negative", self)

    def cos(self) -> Operand:
        """Return the cosine; `numpy.cos` calls this method."""
        return self.tape.emit("cos", self)

    def sin(self) -> Operand:
        """Return the sine; `numpy.sin` calls this method."""
        return self.tape.emit("sin", self)

    def tanh(self) -> Operand:
        """Return the hyperbolic tangent; `numpy.tanh` calls this method."""
        return self.tape.emit("tanh", self)


Operand: TypeAlias = Symbol | float | int | bool
"""Operand of an operation: a symbol or a constant."""


class Program(NamedTuple):
    """A program: the operations that its outputs require, without jumps.

    Attributes:
        inputs: Symbols of its inputs.
        operations: Operations in order.
        outputs: Symbols or constants of its results.
    """

    inputs: tuple[Symbol, ...]
    operations: tuple[Symbol, ...]
    outputs: tuple[Operand, ...]


def is_of_calls(program: Program) -> bool:
    """Return whether a program was traced with calls, and so consists of calls."""
    return any(symbol.operation == "call" for symbol in program.operations)


def operation_count(program: Program) -> int:
    """Return the number of operations of a program, those of programs nested in it in place of these."""
    return sum(operation_count(body) for body in _nested_programs(program)) + sum(
        symbol.operation not in NESTED for symbol in program.operations
    )


def conditional_count(program: Program) -> int:
    """Return the number of loops and branches of a program, at any depth."""
    own_count = sum(symbol.operation in CONDITIONAL for symbol in program.operations)
    return own_count + sum(map(conditional_count, _nested_programs(program)))


def _nested_programs(program: Program) -> Iterator[Program]:
    return (symbol.operands[0].body for symbol in program.operations if symbol.operation in NESTED)


class Loop(NamedTuple):
    """A program that is repeated.

    Attributes:
        body: Program from state and constants to the next state and whether it is the last.
        limit: Largest number of repetitions.
        indices: Indices of the entries of the state among those that were traced.
    """

    body: Program
    limit: int
    indices: tuple[int, ...]


class Branch(NamedTuple):
    """A program that runs only where a Boolean is true.

    Attributes:
        body: Program.
        indices: Indices of the outputs among those that were traced.
    """

    body: Program
    indices: tuple[int, ...]


class Call(NamedTuple):
    """A program that may be shared by several calls.

    Attributes:
        body: Program.
        indices: Indices of the outputs among those that were traced.
    """

    body: Program
    indices: tuple[int, ...]


class Subroutine(NamedTuple):
    """A program that becomes a separate function; its inputs and outputs are real numbers.

    Attributes:
        body: Program, with all outputs.
    """

    body: Program


NESTED = frozenset({"loop", "branch", "call", "subroutine"})
"""Operations that contain a program."""

CONDITIONAL = frozenset({"loop", "branch"})
"""Nested operations that run more than once, or perhaps not at all."""

COMPARISONS = ("less", "less_equal", "greater", "greater_equal", "equal", "not_equal")
LOGICAL = {"logical_and": "and", "logical_or": "or", "logical_not": "not"}
BITWISE = {"bitwise_and": "and", "bitwise_or": "or", "invert": "not"}
COMMUTATIVE = frozenset({"add", "multiply", "logical_and", "logical_or", "bitwise_and", "bitwise_or"})

FUNCTIONS = frozenset(
    {
        *("absolute", "sqrt", "cbrt", "exp", "expm1", "log", "log1p", "power", "hypot", "copysign"),
        *("sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh", "arcsinh"),
    }
)
"""Real functions of real values."""

CHOOSING = frozenset({"maximum", "minimum"})
ARITHMETIC = frozenset({"add", "subtract", "multiply", "divide", "negative"})
NAN_PROPAGATING = (FUNCTIONS | ARITHMETIC | CHOOSING) - {"power", "hypot", "copysign"}
"""Operations that return NaN if any operand is NaN; others may not: 1 to the power of NaN is 1."""

_KINDS = {
    **dict.fromkeys(FUNCTIONS, Kind.REAL),
    **dict.fromkeys((*COMPARISONS, *LOGICAL, "isnan"), Kind.TRUTH),
    **dict.fromkeys(("bits", "bitwise_and", "bitwise_or"), Kind.BITS),
    "searchsorted": Kind.INDEX,
    "take": Kind.REAL,
}


def kind_of(operand: Any) -> Kind:
    """Return the kind of a value; a plain integer counts as a real number."""
    if isinstance(operand, Symbol):
        return operand.kind
    return Kind.TRUTH if isinstance(operand, bool) else Kind.REAL


def kinds_of_operands(symbol: Symbol) -> list[Kind]:
    """Return the kind of each operand, which determines the notation of a constant."""
    if symbol.operation == "where":
        return [Kind.TRUTH, symbol.kind, symbol.kind]
    if symbol.operation == "bits":
        return [Kind.TRUTH, Kind.BITS]
    if symbol.operation == "item":
        return [Kind.REAL, Kind.INDEX]
    if symbol.operation in NESTED:
        nested = symbol.operands[0]
        inputs = [inner.kind for inner in nested.body.inputs]
        results = list(map(kind_of, nested.body.outputs))
        return [Kind.REAL, *([Kind.TRUTH, *results] if symbol.operation == "branch" else []), *inputs]
    constant_kind = Kind.INDEX if symbol.operation == "take" else Kind.REAL
    kind = next((operand.kind for operand in symbol.operands if isinstance(operand, Symbol)), constant_kind)
    return [kind] * len(symbol.operands)


def result_kind(operation: str, operands: Sequence[Any]) -> Kind:
    """Return the kind of an operation's result.

    Raises:
        NotImplementedError: The operation cannot be recorded.
    """
    if operation in _KINDS:
        return _KINDS[operation]
    if operation == "where":
        return _common_kind(operands[1:])
    if operation in ARITHMETIC | CHOOSING:
        return _kind_of_number(operation, operands)
    raise NotImplementedError(f"the operation {operation} cannot be recorded")


def _kind_of_number(operation: str, operands: Sequence[Any]) -> Kind:
    kind = _common_kind(operands)
    if kind is Kind.TRUTH:
        raise NotImplementedError(
            f"{operation} of a truth value cannot be recorded; numpy.where makes a number of it"
        )
    if kind is Kind.INDEX and not all(isinstance(operand, Symbol | int) for operand in operands):
        raise NotImplementedError(f"{operation} of an index is recorded with whole numbers only")
    return kind


def _common_kind(operands: Sequence[Any]) -> Kind:
    """Return the kind of the symbols; constants adapt."""
    kinds = {operand.kind for operand in operands if isinstance(operand, Symbol)}
    kinds = kinds or set(map(kind_of, operands))
    if len(kinds) > 1:
        raise NotImplementedError(f"values of different kinds cannot be joined: {kinds}")
    return kinds.pop()


def table_uses(*programs: Program) -> Iterator[tuple[SelectionTable, str]]:
    """Yield tables with the operations on them, also of nested programs, each of which is visited once."""
    visited: set[int] = set()
    for program in programs:
        yield from _table_uses(program, visited)


def _table_uses(program: Program, visited: set[int]) -> Iterator[tuple[SelectionTable, str]]:
    if id(program) in visited:
        return
    visited.add(id(program))
    for symbol in program.operations:
        for operand in symbol.operands:
            if isinstance(operand, SelectionTable):
                yield operand, symbol.operation
            elif isinstance(operand, Loop | Branch | Call | Subroutine):
                yield from _table_uses(operand.body, visited)
