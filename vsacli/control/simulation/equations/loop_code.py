"""C for the equations of motion of a closed loop, with the numbers of robot and controller as data."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.engine.compiled_engine import operation_count
from vsacli.compute.engine.libraries import Code
from vsacli.compute.tracing import Program
from vsacli.compute.tracing.c_code import Writer, digits, table_declarations
from vsacli.compute.tracing.c_tables import Tables
from vsacli.control.codegen.scalar import HELPERS, PRECISIONS, Scalar, helper_text
from vsacli.control.simulation.equations.recording import Recording


class _Numbers(Scalar):
    """Plain C whose constants are entries of an array, in the order in which they are written.

    Robots that differ in numbers alone so have the same text.

    Attributes:
        values: the constants.
    """

    def __init__(self) -> None:
        super().__init__("double")
        self.values: list[float] = []

    def real(self, number: float) -> str:
        """As of `Dialect`."""
        self.values.append(number)
        return f"p[{len(self.values) - 1}]"

    def entry(self, number: float, array_type: str) -> str:
        """As of `Dialect`; tables stay in the text."""
        return digits(number) if array_type in PRECISIONS else super().entry(number, array_type)


def loop_code(recording: Recording) -> tuple[Code, FloatArray]:
    """What to compile for a recording, and the numbers that the code is to be given."""
    numbers = _Numbers()
    tables = Tables((each.program for each in recording), numbers.array_type)
    writer = Writer(numbers, tables)
    lines = [
        f"#define ENTRIES {recording.entries}",
        f"#define COLUMNS {max(sum(table.columns for table in each.tables) for each in recording)}",
        files("vsacli.control.simulation.equations").joinpath("loop.c").read_text(encoding="utf-8"),
        *(helper_text(name, "double") for name in HELPERS),
        *table_declarations(tables, numbers),
    ]
    for name, each in recording._asdict().items():
        lines += _function(name, each.program, recording.entries, writer)
    functions = tuple(operation_count(each.program) for each in recording)
    return Code("\n".join([*lines, ""]), sum(functions), functions), np.array(numbers.values)


def _function(name: str, program: Program, entries: int, writer: Writer) -> Iterator[str]:
    """A function of a program, whose inputs are the entries of a state, then columns of tables."""
    places = (
        f"y[{number}]" if number < entries else f"s[{number - entries}]"
        for number in range(len(program.inputs))
    )
    names = {symbol.index: place for symbol, place in zip(program.inputs, places, strict=True)}
    head = f"static void {name}(const double *p, const double *y, const double *s, double *result)"
    return writer.definition(head, program, names, "result")
