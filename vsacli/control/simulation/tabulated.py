"""Functions of time that are costly at one instant, as piecewise polynomials through blocks of samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from vsacli.base.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

DEGREE = 7
FIRST_CELLS = 32
"""Cells that the span is divided into at first; those that the polynomial does not fit are halved."""

TOLERANCE = 1e-12
"""Error, relative to the largest value of its column, with which a cell fits: some hundred times rounding."""

GAIN = 4.0
"""Factor by which halving must lower the error to be worth another one: 256 where the function is smooth,
nothing where the error is noise of the function itself."""

HALVINGS = 10
"""To where the function ends, say, within a thousandth of a first cell."""

_NODES = (1 - np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))) / 2
"""Chebyshev's, in shares of a cell."""

_PROBES = np.array([0.002, 0.5, 0.998])
"""Where a polynomial through these nodes errs most."""

_TO_POWERS = np.linalg.inv(np.vander(_NODES))
"""Values at the nodes to coefficients of powers, the highest first."""

_TO_PROBES = np.vander(_PROBES, DEGREE + 1) @ _TO_POWERS


def tabulate(function: Callable[[FloatArray], FloatArray], breakpoints: FloatArray) -> PPoly[Any]:
    """A piecewise polynomial that stands for a function of time, to about `TOLERANCE`.

    Args:
        function: values (samples, columns) at times (samples,); analytic between breakpoints, or NaN.
        breakpoints: ascending times, s; the first and last are the span.
    """
    from scipy.interpolate import PPoly

    ends = np.union1d(breakpoints, np.linspace(breakpoints[0], breakpoints[-1], FIRST_CELLS + 1))
    starts, lengths = ends[:-1], np.diff(ends)
    before = np.full(len(starts), np.inf)
    peak: FloatArray | None = None
    cells: list[tuple[FloatArray, FloatArray]] = []
    for halving in range(HALVINGS + 1):
        nodes, probes = _sampled(function, starts, lengths)
        peak = np.fmax.reduce(np.abs(nodes), axis=(0, 1)) if peak is None else peak
        error = _misfit(nodes, probes, peak)
        halve = (error > TOLERANCE) & ((error < before / GAIN) | np.isinf(error)) & (halving < HALVINGS)
        cells.append((starts[~halve], _coefficients(nodes[~halve], lengths[~halve])))
        if not halve.any():
            break
        starts, lengths = _halved(starts[halve], lengths[halve])
        before = np.tile(error[halve], 2)
    first, coefficients = (np.concatenate(parts) for parts in zip(*cells, strict=True))
    order = np.argsort(first)
    return PPoly(np.moveaxis(coefficients[order], 1, 0), np.append(first[order], ends[-1]))


def first_undefined(table: PPoly[Any]) -> tuple[float, int] | None:
    """Start of the first cell in which a column is NaN, s, and the column; None if there is none."""
    undefined = np.isnan(table.c).any(axis=0)
    cell = int(undefined.any(axis=1).argmax())
    return (float(table.x[cell]), int(undefined[cell].argmax())) if undefined.any() else None


def _sampled(
    function: Callable[[FloatArray], FloatArray], starts: FloatArray, lengths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Values at the nodes and at the probes of each cell, (cells, nodes, columns)."""
    times = starts[:, None] + lengths[:, None] * np.concatenate((_NODES, _PROBES))
    values = function(times.ravel()).reshape(*times.shape, -1)
    return values[:, : len(_NODES)], values[:, len(_NODES) :]


def _misfit(nodes: FloatArray, probes: FloatArray, peak: FloatArray) -> FloatArray:
    """Largest error of the polynomial in each cell, relative to the peak of its column, (cells,).

    Infinite where a column is NaN in a part of the cell only; a column that is NaN throughout does not count.
    """
    values = np.concatenate((nodes, probes), axis=1)
    missing = np.isnan(values)
    ends_here = np.any(np.any(missing, axis=1) & ~np.all(missing, axis=1), axis=1)
    error = np.abs(np.einsum("pn,cnk->cpk", _TO_PROBES, nodes) - probes)
    share = np.divide(error, peak, out=np.zeros_like(error), where=peak > 0)
    return np.where(ends_here, np.inf, np.nan_to_num(share).max(axis=(1, 2)))


def _coefficients(nodes: FloatArray, lengths: FloatArray) -> FloatArray:
    """Of powers of the time elapsed in the cell, (cells, powers, columns)."""
    scale = lengths[:, None, None] ** -np.arange(DEGREE, -1.0, -1.0)[:, None]
    return np.asarray(np.einsum("pn,cnk->cpk", _TO_POWERS, nodes) * scale, dtype=np.float64)


def _halved(starts: FloatArray, lengths: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.concatenate((starts, starts + lengths / 2)), np.tile(lengths / 2, 2)
