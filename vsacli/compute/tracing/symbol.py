"""Values that are known only when a recorded program runs."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from vsacli.compute.vector import Scalar

if TYPE_CHECKING:
    from vsacli.compute.tracing.tape import Tape


class Kind(enum.Enum):
    """What a value is: a floating-point number, a truth value, a field of bits, or an index of a table."""

    REAL = enum.auto()
    TRUTH = enum.auto()
    BITS = enum.auto()
    INDEX = enum.auto()


@dataclass(frozen=True)
class Table:
    """Constants among which an operation chooses."""

    values: tuple[float, ...]


class Symbol:
    """An input of a program, or the result of an operation, as a scalar with + - * / cos sin.

    Attributes:
        tape: where the operation is recorded.
        index: number of the value on the tape.
        operation: as `Tape.record` has it; "input" for an input.
        operands: of the operation; first comes what is fixed, a table or the body of a loop, if anything is.
        kind: of the value.
    """

    __slots__ = ("index", "kind", "operands", "operation", "tape")

    def __init__(self, tape: Tape, index: int, operation: str, operands: tuple[Any, ...], kind: Kind) -> None:
        self.tape = tape
        self.index = index
        self.operation = operation
        self.operands = operands
        self.kind = kind

    def __add__(self, other: Scalar) -> Operand:
        return self.tape.record("add", self, other)

    def __sub__(self, other: Scalar) -> Operand:
        return self.tape.record("subtract", self, other)

    def __mul__(self, other: Scalar) -> Operand:
        return self.tape.record("multiply", self, other)

    def __truediv__(self, other: Scalar) -> Operand:
        return self.tape.record("divide", self, other)

    def __rsub__(self, other: Scalar) -> Operand:
        return self.tape.record("subtract", other, self)

    def __rtruediv__(self, other: Scalar) -> Operand:
        return self.tape.record("divide", other, self)

    __radd__ = __add__
    __rmul__ = __mul__

    def __neg__(self) -> Operand:
        return self.tape.record("negative", self)

    def cos(self) -> Operand:
        """Cosine; what `numpy.cos` calls."""
        return self.tape.record("cos", self)

    def sin(self) -> Operand:
        """Sine; what `numpy.sin` calls."""
        return self.tape.record("sin", self)


Operand: TypeAlias = Symbol | float | int | bool
"""What an operation acts on: a symbol or a constant."""
