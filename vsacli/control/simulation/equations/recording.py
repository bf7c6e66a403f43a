"""The equations of motion of a closed loop as programs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from vsacli.compute.tracing import MOST_RECORDED, Program, Tape, TracedArray, cells_of
from vsacli.control.simulation.boundaries import Boundary
from vsacli.control.simulation.closed_loop import ClosedLoop
from vsacli.control.simulation.table import Instant, Table


class Recording(NamedTuple):
    """What a closed loop does at an instant.

    Attributes:
        rates: from the state vector, and what the tables have then, to its time derivative.
        distances: from the state vector to the distance to each boundary.
        tables: those that `rates` reads, in this order.
    """

    rates: Program
    distances: Program
    tables: tuple[Table, ...]

    @property
    def entries(self) -> int:
        """Of a state vector."""
        return len(self.rates.outputs)


def record(loop: ClosedLoop, boundaries: Sequence[Boundary]) -> Recording:
    """Record a closed loop.

    Args:
        loop: a robot under its controller; torques that it holds are an input.
        boundaries: where its runs end.

    Raises:
        NotImplementedError: it has no such program, or one of too many operations.
    """
    if loop.slip is not None:
        raise NotImplementedError("motors with sharp friction stick and slide")
    tape, entries = Tape(MOST_RECORDED), loop.packing.entries
    instant: Any = Instant(lambda count: _inputs(tape, count))
    vector = _inputs(tape, entries)
    try:
        rates = tape.program(cells_of(loop.derivative(instant, vector)).tolist())
        return Recording(rates, _distances(boundaries, entries), tuple(instant.tables))
    except (AttributeError, IndexError, TypeError, ValueError) as error:  # as of a law of the user's own
        raise NotImplementedError(f"it takes more than NumPy's functions of arrays: {error}") from error


def _distances(boundaries: Sequence[Boundary], entries: int) -> Program:
    tape = Tape(MOST_RECORDED)
    vector = _inputs(tape, entries)
    return tape.program([cells_of(each.distance(vector)).item() for each in boundaries])


def _inputs(tape: Tape, count: int) -> Any:
    """Further inputs, in place of an array of numbers."""
    return TracedArray(tape, tape.inputs(count))
