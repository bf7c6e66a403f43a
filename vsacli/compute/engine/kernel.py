"""Computations on rows of samples, and what recording leaves of them."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from vsacli.compute.tracing import Listing, Symbol

TURNS = 5
"""How often a loop is usually repeated."""


class Kernel(Hashable, Protocol):
    """A function of rows of samples that NumPy computes and a tape records; equal ones compute the same."""

    @property
    def inputs(self) -> int:
        """How many rows it takes."""

    @property
    def outputs(self) -> int:
        """How many rows it gives."""

    def __call__(self, rows: Sequence[Any]) -> Sequence[Any]:
        """Rows of results, (samples,), or constants in their place.

        Every sample is computed by itself, without a branch on its values.
        """


def operations(listing: Listing) -> int:
    """How many operations a program has, those of loops counted as often as they are usually repeated."""
    return sum(map(_weight, listing.operations))


def _weight(symbol: Symbol) -> int:
    if symbol.operation == "loop":
        return TURNS * operations(symbol.operands[0].body)
    return operations(symbol.operands[0].body) if symbol.operation == "branch" else 1


def record(kernel: Kernel) -> Listing:
    """The operations of a kernel on one sample."""
    from vsacli.compute.tracing import Tape, TracedArray, cells_of

    tape = Tape()
    rows = [TracedArray(tape, [symbol]) for symbol in tape.inputs(kernel.inputs)]
    return tape.listing([cells_of(output).item() for output in kernel(rows)])
