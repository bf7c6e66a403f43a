"""A closed loop recorded as programs, and their C code with parameters of robot and controller as data."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.engine.compiled_engine import compiling_size
from vsacli.compute.engine.libraries import Code
from vsacli.compute.tracing import MOST_RECORDED, Program, Tape, TracedArray, cells_of
from vsacli.compute.tracing.c_code import Tables, Writer, digits, table_declarations
from vsacli.control.codegen.scalar import HELPERS, helper_text, scalar_dialect
from vsacli.control.simulation.boundaries import Boundary
from vsacli.control.simulation.closed_loop import ClosedLoop
from vsacli.control.simulation.tabulated import Instant, Table


class StateProgram(NamedTuple):
    """A program whose inputs are the entries of a state vector, then the columns of tables at a time."""

    program: Program
    tables: tuple[Table, ...]


class LoopPrograms(NamedTuple):
    """The recorded closed loop at an instant.

    Attributes:
        rates: program of the time derivative of the state vector.
        torques: program of the torques that a controller which holds them commands; no outputs for others.
        distances: program of the distance to each boundary.
    """

    rates: StateProgram
    torques: StateProgram
    distances: StateProgram

    @property
    def entries(self) -> int:
        """Number of entries of a state vector."""
        return len(self.rates.program.outputs)


def record_loop(loop: ClosedLoop, boundaries: Sequence[Boundary]) -> LoopPrograms:
    """Record a closed loop.

    Args:
        loop: robot under its controller; torques that it holds become a table.
        boundaries: boundaries at which its runs end.

    Raises:
        NotImplementedError: the loop has no such program, or one of too many operations.
    """
    if loop.slip is not None:
        raise NotImplementedError("motors with sharp friction stick and slide")

    def torques(time: Any, vector: FloatArray) -> FloatArray:
        return vector[:0] if loop.held is None else loop.controller_torque(time, vector)

    def distances(_time: Any, vector: FloatArray) -> FloatArray:
        return np.concatenate(
            [vector[:0], *(boundary.distance(vector).reshape(1) for boundary in boundaries)]
        )

    try:
        programs = (
            _record_program(function, loop.packing.entries)
            for function in (loop.derivative, torques, distances)
        )
        return LoopPrograms(*programs)
    except (AttributeError, IndexError, TypeError, ValueError) as error:  # e.g. from a user's own spring law
        raise NotImplementedError(f"it takes more than NumPy's functions of arrays: {error}") from error


def _record_program(function: Callable[[Any, Any], Any], entries: int) -> StateProgram:
    tape = Tape(MOST_RECORDED)

    def inputs(count: int) -> Any:
        return TracedArray(tape, tape.inputs(count))

    vector, instant = inputs(entries), Instant(inputs)
    program = tape.program(cells_of(function(instant, vector)).tolist())
    return StateProgram(program, tuple(instant.tables))


def loop_code(recording: LoopPrograms) -> tuple[Code, FloatArray]:
    """Return the C code of a recording, and the constants to be passed to it.

    Constants are entries of an array, in the order in which they are written, so that robots that differ only
    in parameters have the same text. Tables stay in the text.
    """
    constants: list[float] = []

    def real(number: float) -> str:
        constants.append(number)
        return f"p[{len(constants) - 1}]"

    dialect = scalar_dialect("double")._replace(real=real, literal=digits)
    tables = Tables((state_program.program for state_program in recording), dialect.array_type)
    writer = Writer(dialect, tables)
    lines = [
        f"#define ENTRIES {recording.entries}",
        f"#define COLUMNS {max(sum(table.columns for table in program.tables) for program in recording)}",
        files("vsacli.control.simulation").joinpath("loop.c").read_text(encoding="utf-8"),
        *(helper_text(name, "double") for name in HELPERS),
        *table_declarations(tables, dialect),
    ]
    for name, state_program in recording._asdict().items():
        lines += _c_function(name, state_program.program, recording.entries, writer)
    functions = tuple(compiling_size(state_program.program) for state_program in recording)
    return Code("\n".join([*lines, ""]), sum(functions), functions), np.array(constants)


def _c_function(name: str, program: Program, entries: int, writer: Writer) -> Iterator[str]:
    """Return the C function of a program, whose inputs are the entries of a state, then columns of tables."""
    input_texts = (
        f"y[{index}]" if index < entries else f"s[{index - entries}]" for index in range(len(program.inputs))
    )
    names = {symbol.index: text for symbol, text in zip(program.inputs, input_texts, strict=True)}
    head = f"static void {name}(const double *p, const double *y, const double *s, double *result)"
    return writer.definition(head, program, names, "result")
