"""The equations of motion of a closed loop as programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.tracing import MOST_RECORDED, Program, Tape, TracedArray, cells_of
from vsacli.control.simulation.boundaries import Boundary
from vsacli.control.simulation.closed_loop import ClosedLoop
from vsacli.control.simulation.table import Instant, Table


class Recorded(NamedTuple):
    """A program of a state vector and of what tables have at a time, its inputs in this order."""

    program: Program
    tables: tuple[Table, ...]


class Recording(NamedTuple):
    """What a closed loop does at an instant.

    Attributes:
        rates: time derivative of the state vector.
        torques: that a controller which holds them asks for; none of others.
        distances: to each boundary.
    """

    rates: Recorded
    torques: Recorded
    distances: Recorded

    @property
    def entries(self) -> int:
        """Of a state vector."""
        return len(self.rates.program.outputs)


def record(loop: ClosedLoop, boundaries: Sequence[Boundary]) -> Recording:
    """Record a closed loop.

    Args:
        loop: a robot under its controller; torques that it holds are a table.
        boundaries: where its runs end.

    Raises:
        NotImplementedError: it has no such program, or one of too many operations.
    """
    if loop.slip is not None:
        raise NotImplementedError("motors with sharp friction stick and slide")

    def torques(time: Any, vector: FloatArray) -> FloatArray:
        return vector[:0] if loop.held is None else loop.controller_torque(time, vector)

    def distances(_time: Any, vector: FloatArray) -> FloatArray:
        return np.concatenate([vector[:0], *(each.distance(vector).reshape(1) for each in boundaries)])

    try:
        parts = (_recorded(each, loop.packing.entries) for each in (loop.derivative, torques, distances))
        return Recording(*parts)
    except (AttributeError, IndexError, TypeError, ValueError) as error:  # as of a law of the user's own
        raise NotImplementedError(f"it takes more than NumPy's functions of arrays: {error}") from error


def _recorded(function: Callable[[Any, Any], Any], entries: int) -> Recorded:
    """A function of a time and a state vector."""
    tape = Tape(MOST_RECORDED)

    def inputs(count: int) -> Any:
        return TracedArray(tape, tape.inputs(count))

    vector, instant = inputs(entries), Instant(inputs)
    program = tape.program(cells_of(function(instant, vector)).tolist())
    return Recorded(program, tuple(instant.tables))
