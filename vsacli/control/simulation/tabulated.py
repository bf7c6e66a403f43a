"""Functions of time as piecewise polynomials, since evaluating them at one instant at a time is slow.

`tabulate` interpolates at Chebyshev nodes, and halves cells until the error is small. A `Table` is an input
of recorded programs; a `TabulatedReference` is the tabulated trajectory that a controller follows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.signals import COMMANDED, DAMPING, POSITION
from vsacli.base.wrench import WRENCH_NAMES, Wrench
from vsacli.trajectory.trajectory import Motion, Trajectory


class Table:
    """Columns as piecewise polynomials of time; called with an `Instant`, they become inputs of a program.

    Attributes:
        ends: ends of the cells, (cells + 1,), s.
        coefficients: coefficients of powers of the time in the cell, highest first, (cells, powers, columns).
    """

    def __init__(self, ends: FloatArray, coefficients: FloatArray) -> None:
        self.ends = np.ascontiguousarray(ends)
        self.coefficients = np.ascontiguousarray(coefficients)

    @classmethod
    def of(cls, function: Callable[[FloatArray], FloatArray], breakpoints: FloatArray) -> Table:
        """Return the table of a function of time; see `tabulate`."""
        return cls(*tabulate(function, breakpoints))

    @property
    def columns(self) -> int:
        """Number of columns."""
        return int(self.coefficients.shape[2])

    @property
    def first_undefined(self) -> tuple[float, int] | None:
        """Start of the first cell in which a column is NaN, s, and this column; None without one."""
        undefined: BoolArray = np.any(np.isnan(self.coefficients), axis=1)
        cell = int(undefined.any(axis=1).argmax())
        return (float(self.ends[cell]), int(undefined[cell].argmax())) if undefined.any() else None

    def __call__(self, time: Any) -> FloatArray:
        """Return the columns at a time, (columns,), or at times, (samples, columns)."""
        return time.columns_of(self) if isinstance(time, Instant) else self._columns_at(time)

    def _columns_at(self, time: float | FloatArray) -> FloatArray:
        if np.ndim(time):
            cells = np.searchsorted(self.ends[1:-1], time, "right")
            elapsed = (time - self.ends[cells])[:, None]
            values: FloatArray = self.coefficients[cells, 0]
            for power in range(1, self.coefficients.shape[1]):
                values = values * elapsed + self.coefficients[cells, power]
            return values
        cell = int(np.searchsorted(self.ends[1:-1], time, "right"))
        powers = (time - self.ends[cell]) ** np.arange(len(self.coefficients[cell]) - 1, -1, -1)
        columns: FloatArray = powers @ self.coefficients[cell]
        return columns


class ConstantTable(Table):
    """Columns that do not depend on time, (columns,), until they are set again."""

    def __init__(self, values: FloatArray) -> None:
        super().__init__(np.array([0.0, 1.0]), values[None, None].copy())

    def set(self, values: FloatArray) -> None:
        """Set the values from now on."""
        self.coefficients[0, 0] = values

    def _columns_at(self, _time: float | FloatArray) -> FloatArray:
        values: FloatArray = self.coefficients[0, 0]
        return values


class Instant:
    """The time of a program in recording, at which the columns of tables become inputs of the program.

    Args:
        inputs: function that returns a number of further inputs as an array.

    Attributes:
        tables: tables that were read, in the order of their inputs, with these inputs.
    """

    def __init__(self, inputs: Callable[[int], FloatArray]) -> None:
        self._inputs = inputs
        self.tables: dict[Table, FloatArray] = {}

    def columns_of(self, table: Table) -> FloatArray:
        """Return the inputs for the columns of a table."""
        if table not in self.tables:
            self.tables[table] = self._inputs(table.columns)
        return self.tables[table]


DEGREE = 7
FIRST_CELLS = 32
"""Initial number of cells of the span; cells with a poor fit are halved."""

TOLERANCE = 1e-12
"""Largest error of a cell, relative to the largest value of its column: some hundred times rounding."""

GAIN = 4.0
"""Factor by which halving must lower the error for another halving. It is 256 where the function is smooth,
and about 1 where the error is noise of the function itself."""

HALVINGS = 10
"""Most halvings, which locate the end of a function to a thousandth of an initial cell."""

_NODES = (1 - np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))) / 2
"""Chebyshev nodes, as shares of a cell."""

_PROBES = np.array([0.002, 0.5, 0.998])
"""Points, as shares of a cell, at which a polynomial through these nodes has its largest errors."""

_TO_POWERS = np.linalg.inv(np.vander(_NODES))
"""Matrix from values at the nodes to coefficients of powers, highest power first."""

_TO_PROBES = np.vander(_PROBES, DEGREE + 1) @ _TO_POWERS


def tabulate(
    function: Callable[[FloatArray], FloatArray], breakpoints: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return a piecewise polynomial that approximates a function of time to about `TOLERANCE`.

    Args:
        function: function that returns values, (samples, columns), at times, (samples,), s; analytic between
            breakpoints, or NaN.
        breakpoints: ascending times, s; the first and last are the span.

    Returns:
        Ends of the cells, and coefficients in them, as of `Table`.
    """
    ends = np.union1d(breakpoints, np.linspace(breakpoints[0], breakpoints[-1], FIRST_CELLS + 1))
    starts, lengths = ends[:-1], np.diff(ends)
    previous_error = np.full(len(starts), np.inf)
    peak: FloatArray | None = None
    cells: list[tuple[FloatArray, FloatArray]] = []
    for halving in range(HALVINGS + 1):
        nodes, probes = _sample_cells(function, starts, lengths)
        peak = np.fmax.reduce(np.abs(nodes), axis=(0, 1)) if peak is None else peak
        error = _polynomial_error(nodes, probes, peak)
        is_halved = (
            (error > TOLERANCE) & ((error < previous_error / GAIN) | np.isinf(error)) & (halving < HALVINGS)
        )
        cells.append((starts[~is_halved], _power_coefficients(nodes[~is_halved], lengths[~is_halved])))
        if not is_halved.any():
            break
        starts, lengths = _halve_cells(starts[is_halved], lengths[is_halved])
        previous_error = np.tile(error[is_halved], 2)
    cell_starts, coefficients = (np.concatenate(parts) for parts in zip(*cells, strict=True))
    order = np.argsort(cell_starts)
    return np.append(cell_starts[order], ends[-1]), coefficients[order]


def _sample_cells(
    function: Callable[[FloatArray], FloatArray], starts: FloatArray, lengths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return values at the nodes and at the probes of each cell, (cells, nodes, columns)."""
    times = starts[:, None] + lengths[:, None] * np.concatenate((_NODES, _PROBES))
    values = function(times.ravel()).reshape(*times.shape, -1)
    return values[:, : len(_NODES)], values[:, len(_NODES) :]


def _polynomial_error(nodes: FloatArray, probes: FloatArray, peak: FloatArray) -> FloatArray:
    """Return the largest error of the polynomial in each cell, relative to the peak of its column, (cells,).

    It is infinite if a column is NaN in only a part of the cell; a column that is NaN throughout is ignored.
    """
    values = np.concatenate((nodes, probes), axis=1)
    is_nan = np.isnan(values)
    ends_in_cell = np.any(np.any(is_nan, axis=1) & ~np.all(is_nan, axis=1), axis=1)
    error = np.abs(np.einsum("pn,cnk->cpk", _TO_PROBES, nodes) - probes)
    relative_error = np.divide(error, peak, out=np.zeros_like(error), where=peak > 0)
    return np.where(ends_in_cell, np.inf, np.nan_to_num(relative_error).max(axis=(1, 2)))


def _power_coefficients(nodes: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return the coefficients of powers of the time elapsed in the cell, (cells, powers, columns)."""
    scale = lengths[:, None, None] ** -np.arange(DEGREE, -1.0, -1.0)[:, None]
    return np.asarray(np.einsum("pn,cnk->cpk", _TO_POWERS, nodes) * scale, dtype=np.float64)


def _halve_cells(starts: FloatArray, lengths: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.concatenate((starts, starts + lengths / 2)), np.tile(lengths / 2, 2)


class TabulatedReference:
    """Commands of a trajectory and its wrench, as tabulated functions of time.

    Arrays are (joints,) at one time, and (samples, joints) at times (samples,).

    Attributes:
        frame: frame of the wrench; None without one.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        self.frame = None if trajectory.wrench is None else trajectory.wrench.frame
        signals = (POSITION, *(COMMANDED[key] for key in trajectory.commanded))
        self._commands = _tabulate_variables(
            trajectory, [name for signal in signals for name in signal.names]
        )
        self._wrench = _tabulate_variables(trajectory, WRENCH_NAMES) if self.frame else None
        has_damping = DAMPING.key in trajectory.commanded
        self._damping = _tabulate_variables(trajectory, DAMPING.names) if has_damping else None

    def __call__(self, time: float | FloatArray) -> Motion:
        """Return motion, commanded signals and wrench."""
        return Motion.of(np.asarray(time), self._commands(time), self.wrench(time))

    def damping(self, time: float | FloatArray) -> dict[str, FloatArray]:
        """Return the commanded damping and its derivatives by name; empty if none is commanded."""
        return {} if self._damping is None else self._damping(time)

    def wrench(self, time: float | FloatArray) -> Wrench | None:
        """Return the wrench; None without one."""
        return None if self._wrench is None else Wrench(**self._wrench(time), frame=self.frame or "")


def _tabulate_variables(
    trajectory: Trajectory, names: Sequence[str]
) -> Callable[[float | FloatArray], dict[str, FloatArray]]:
    """Return a function of time that gives variables of the motion by name."""

    def columns(time: FloatArray) -> FloatArray:
        variables = trajectory.at(time).variables()
        return np.concatenate([variables[name] for name in names], axis=1)

    table = Table.of(columns, trajectory.breakpoints)
    width = table.columns // len(names)
    parts = [slice(start, start + width) for start in range(0, table.columns, width)]

    def arrays(time: float | FloatArray) -> dict[str, FloatArray]:
        values = table(time)
        return {
            name: values[..., columns_of_name] for name, columns_of_name in zip(names, parts, strict=True)
        }

    return arrays
