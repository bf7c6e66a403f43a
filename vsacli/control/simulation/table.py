"""Tables over time that a recorded program reads as inputs."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.control.simulation.tabulated import tabulate

if TYPE_CHECKING:
    from scipy.interpolate import PPoly


class Table:
    """Columns as piecewise polynomials of time; called with an `Instant`, it is an input of a program.

    Attributes:
        ends: of the cells, (cells + 1,), s.
        coefficients: of powers of the time elapsed in the cell, highest first, (cells, powers, columns).
    """

    def __init__(self, ends: FloatArray, coefficients: FloatArray) -> None:
        self.ends = np.ascontiguousarray(ends)
        self.coefficients = np.ascontiguousarray(coefficients)

    @classmethod
    def of(cls, function: Callable[[FloatArray], FloatArray], breakpoints: FloatArray) -> Table:
        """Of a function of time; see `tabulate`."""
        polynomial = tabulate(function, breakpoints)
        return cls(polynomial.x, np.moveaxis(polynomial.c, 1, 0))

    @property
    def columns(self) -> int:
        """How many there are."""
        return int(self.coefficients.shape[2])

    @cached_property
    def polynomial(self) -> PPoly[Any]:
        """The same as SciPy has it."""
        from scipy.interpolate import PPoly

        return PPoly(np.moveaxis(self.coefficients, 1, 0), self.ends)

    def __call__(self, time: Any) -> FloatArray:
        """Columns at a time, (columns,), or at times (samples,), (samples, columns)."""
        return time.columns_of(self) if isinstance(time, Instant) else self._at(time)

    def _at(self, time: float | FloatArray) -> FloatArray:
        if np.ndim(time):
            return self.polynomial(time)
        cell = int(np.searchsorted(self.ends[1:-1], time, "right"))
        powers = (time - self.ends[cell]) ** np.arange(len(self.coefficients[cell]) - 1, -1, -1)
        columns: FloatArray = powers @ self.coefficients[cell]
        return columns


class Constant(Table):
    """Columns that stay as they are until they are set; (columns,) whatever the time."""

    def __init__(self, values: FloatArray) -> None:
        super().__init__(np.array([0.0, 1.0]), values[None, None].copy())

    def set(self, values: FloatArray) -> None:
        """From now on."""
        self.coefficients[0, 0] = values

    def _at(self, _time: float | FloatArray) -> FloatArray:
        values: FloatArray = self.coefficients[0, 0]
        return values


class Instant:
    """The time of a program: what tables have then are inputs of it.

    Args:
        inputs: makes so many further inputs, as an array.

    Attributes:
        tables: those that were read, in the order of their inputs.
    """

    def __init__(self, inputs: Callable[[int], FloatArray]) -> None:
        self._inputs = inputs
        self.tables: dict[Table, FloatArray] = {}

    def columns_of(self, table: Table) -> FloatArray:
        """What a table has at this time."""
        if table not in self.tables:
            self.tables[table] = self._inputs(table.columns)
        return self.tables[table]
