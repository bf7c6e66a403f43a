"""The tape: operations in the order of their execution, with constant folding and common subexpressions."""

from __future__ import annotations

import sys
from collections.abc import Hashable, Sequence
from typing import Any

from vsacli.compute.rounding import OfRounding
from vsacli.compute.tracing.calls import with_outlined_runs, with_shared_bodies
from vsacli.compute.tracing.program import (
    COMMUTATIVE,
    Branch,
    Call,
    Kind,
    Loop,
    Operand,
    Program,
    SelectionTable,
    Subroutine,
    Symbol,
    kind_of,
    operation_count,
    result_kind,
)
from vsacli.compute.tracing.simplification import fold_operation, without_dead_code

MOST_RECORDED = 50_000
"""Largest number of operations recorded for one function: gcc then takes a minute and 0.6 GB."""


class TooLongError(NotImplementedError):
    """A kernel has more operations than may be recorded."""


class Tape:
    """Operations in the order of their execution; a common subexpression is recorded once.

    Args:
        max_operations: Largest number of operations; beyond it `TooLongError` is raised.
        calling: Whether calls are recorded as such, or expanded.
        short: Whether subroutines are separate functions, or recorded inline.
        conditional: Number of operations as which a loop or branch counts, in addition to those of its body;
            None if neither counts.

    Attributes:
        calls: Recorded calls, by their keys.
    """

    def __init__(
        self,
        max_operations: int = sys.maxsize,
        calling: bool = False,
        short: bool = False,
        conditional: int | None = None,
    ) -> None:
        self._max_operations, self._conditional = max_operations, conditional
        self._nested_count = 0
        self.short = short
        self.calling = calling
        self.calls: dict[Hashable, Any] = {}
        self._symbols: dict[Hashable, Symbol] = {}
        self._inputs: list[Symbol] = []
        self._is_finished = False

    def inputs(self, count: int) -> list[Symbol]:
        """Return new real variables, which a program receives in this order."""
        return [self.input(Kind.REAL) for _ in range(count)]

    def input(self, kind: Kind) -> Symbol:
        """Return a new variable."""
        symbol = self._new_symbol("input", (), kind)
        self._inputs.append(symbol)
        return symbol

    def emit(self, operation: str, *operands: Operand | SelectionTable) -> Operand:
        """Return the result of an operation on symbols and constants, named as the NumPy function.

        In addition there are `bits(truth, mask)`, the mask where true, else 0; and `take(table, index)`.
        """
        arguments = tuple(map(_python_number, operands))
        constant = fold_operation(operation, arguments)
        if constant is not None:
            return constant
        key = _expression_key(operation, arguments)
        recorded = self._symbols.get(key)
        return recorded or self._new_symbol(operation, arguments, result_kind(operation, arguments), key)

    def emit_loop(
        self, body: Program, limit: int, state: Sequence[Operand], constants: Sequence[Operand]
    ) -> list[Symbol]:
        """Return the state after the repetition of a program that was traced on a separate tape."""
        self._count_nested(body)
        loop = Loop(body, limit, tuple(range(len(state))))
        return self._emit_nested("loop", body.outputs[:-1], (loop, *state, *constants))

    def emit_branch(
        self, truth: Operand, body: Program, arguments: Sequence[Operand], otherwise: Sequence[Operand]
    ) -> list[Symbol]:
        """Add a program that runs where a Boolean is true, and values elsewhere; return the results."""
        self._count_nested(body)
        branch = Branch(body, tuple(range(len(otherwise))))
        return self._emit_nested("branch", body.outputs, (branch, truth, *otherwise, *arguments))

    def emit_call(self, body: Program, arguments: Sequence[Operand]) -> list[Symbol]:
        """Add a call of a program traced on a separate tape; return its results."""
        call = Call(body, tuple(range(len(body.outputs))))
        return self._emit_nested("call", body.outputs, (call, *arguments))

    def emit_subroutine(self, body: Program, arguments: Sequence[Operand]) -> list[Symbol]:
        """Add a call of a subroutine, which several places may share; return its results."""
        return self._emit_nested("subroutine", body.outputs, (Subroutine(body), *arguments))

    def _count_nested(self, body: Program) -> None:
        if self._conditional is not None:
            self._nested_count += self._conditional + operation_count(body)

    def _emit_nested(
        self, operation: str, outputs: Sequence[Operand], operands: tuple[Any, ...]
    ) -> list[Symbol]:
        nested = self._new_symbol(operation, operands, Kind.REAL)
        return [
            self._new_symbol("item", (nested, number), kind_of(output))
            for number, output in enumerate(outputs)
        ]

    def _new_symbol(
        self, operation: str, operands: tuple[Any, ...], kind: Kind, key: Hashable | None = None
    ) -> Symbol:
        """Return a new symbol; without a key it is never a common subexpression."""
        if any(isinstance(operand, Symbol) and operand.tape is not self for operand in operands):
            message = "a value of another program cannot be used in this one; pass it as an argument"
            raise NotImplementedError(message)
        if self._is_finished:
            raise RuntimeError("nothing can be added to a tape once its program is made")
        if len(self._symbols) + self._nested_count >= self._max_operations:
            raise TooLongError(f"a step takes more than {self._max_operations} operations")
        symbol = Symbol(self, len(self._symbols), operation, operands, kind)
        self._symbols[symbol if key is None else key] = symbol
        return symbol

    def program(self, outputs: Sequence[Operand]) -> Program:
        """Return the program from the inputs to these outputs, without dead code and with calls.

        The tape cannot be used afterwards: it is emptied, since symbols refer to it and would keep its
        contents.
        """
        operations = [symbol for symbol in self._symbols.values() if symbol.operation != "input"]
        program = without_dead_code(self._inputs, operations, [*map(_python_number, outputs)])
        self._is_finished = True
        self._symbols.clear()
        self.calls.clear()
        return with_shared_bodies(with_outlined_runs(program)) if self.calling else program


def _python_number(operand: Any) -> Any:
    """Return constants as numbers of Python."""
    return operand if isinstance(operand, Symbol | SelectionTable | int | OfRounding) else float(operand)


def _expression_key(operation: str, operands: tuple[Any, ...]) -> Hashable:
    """Return the key of a common subexpression: operands, constants by digits, integers apart from floats."""
    operand_keys = [
        operand.index
        if isinstance(operand, Symbol)
        else operand
        if isinstance(operand, SelectionTable)
        else repr(operand)
        for operand in operands
    ]
    return (operation, *(sorted(operand_keys, key=str) if operation in COMMUTATIVE else operand_keys))
