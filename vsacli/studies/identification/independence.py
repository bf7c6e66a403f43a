"""Independent columns of a matrix, and the others as combinations of them.

Householder QR with column pivoting (G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed., 2013, section
5.4.2), as M. Gautier, "Numerical calculation of the base inertial parameters of robots", Journal of Robotic
Systems 8 (1991), uses it for parameters of robots.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray, IndexArray

NOTHING = 1e-13
"""Ratio of a column's norm to the largest norm up to which the column is rounding."""

ABOVE_NOISE = 4.0
"""Ratio of a column's independent part to its noise above which it is independent: below, more than a
sixteenth of its square is noise, and its unknown comes out too small by that share."""

CERTAIN = 10.0
"""Multiple of the tolerance below which the share of a column in another is set to zero: a share is as
uncertain as the dependence itself, amplified by the condition number of the independent columns."""


class Independence(NamedTuple):
    """Columns of a matrix, split into independent, dependent and zero columns.

    Attributes:
        kept: indices of independent columns, (kept,); each is the one farthest from the span of the previous.
        dropped: indices of columns that are combinations of the kept ones, (dropped,).
        nothing: indices of zero columns, (nothing,).
        shares: shares of the kept columns in the dropped ones, (kept, dropped).
        scale: norm of each column, (columns,).
        q: orthonormal basis of the kept columns, (rows, kept).
        r: upper triangular factor: `q r` are the kept columns divided by their norms.
        condition: condition number of all nonzero columns divided by their norms.
    """

    kept: IndexArray
    dropped: IndexArray
    nothing: IndexArray
    shares: FloatArray
    scale: FloatArray
    q: FloatArray
    r: FloatArray
    condition: float


def independence(columns: FloatArray, tolerance: float, noise: FloatArray | None = None) -> Independence:
    """Split the columns of a matrix, whatever their units.

    Args:
        columns: matrix, (rows, columns).
        tolerance: distance of a column from the span of the kept ones, relative to its norm, above which it
            is independent.
        noise: noise of the columns, which the remainder of an independent column must exceed.
    """
    scale = np.linalg.norm(columns, axis=0)
    there = np.flatnonzero(scale > NOTHING * scale.max(initial=0.0))
    scaled = columns[:, there] / scale[there]
    of_noise = np.zeros_like(scaled) if noise is None else noise[:, there] / scale[there]
    triangle, of_noise = (np.asarray(np.linalg.qr(each, mode="r")) for each in (scaled, of_noise))
    order = _pivoted(triangle, of_noise, tolerance)
    kept, dropped = there[order], np.setdiff1d(there, there[order])
    q, r = np.linalg.qr(scaled[:, order])
    others = np.setdiff1d(np.arange(len(there)), order)
    shares = scipy.linalg.solve_triangular(r, q.T @ scaled[:, others])
    shares[np.abs(shares) < CERTAIN * tolerance] = 0.0
    return Independence(
        kept=kept,
        dropped=dropped,
        nothing=np.setdiff1d(np.arange(len(scale)), there),
        shares=shares * scale[dropped] / scale[kept][:, None],
        scale=scale,
        q=q,
        r=r,
        condition=float(np.linalg.cond(triangle)) if there.size else 1.0,
    )


def _pivoted(triangle: FloatArray, noise: FloatArray, tolerance: float) -> list[int]:
    """Return indices of the independent columns, in the order of pivoting.

    Args:
        triangle: columns of unit norm, reduced to few rows by QR.
        noise: noise of the columns, reduced by QR; each elimination is applied to it as well.
        tolerance: see `independence`.
    """
    left, noise = triangle.copy(), noise.copy()
    waiting, kept = list(range(left.shape[1])), []
    while waiting:
        size = np.linalg.norm(left[:, waiting], axis=0)
        first_of_largest = int(np.argmax(np.round(size, 9)))
        best = waiting.pop(first_of_largest)
        size_of_best = float(np.max(size))
        if size_of_best > max(tolerance, ABOVE_NOISE * float(np.linalg.norm(noise[:, best]))):
            share = left[:, best] @ left[:, waiting] / size_of_best**2
            left[:, waiting] -= np.outer(left[:, best], share)
            noise[:, waiting] -= np.outer(noise[:, best], share)
            kept.append(best)
    return kept


def first_independent(columns: FloatArray, tolerance: float) -> IndexArray:
    """Return indices of the columns that are not combinations of previous columns; see `independence`."""
    scale = np.linalg.norm(columns, axis=0)
    there = np.flatnonzero(scale > NOTHING * scale.max(initial=0.0))
    r = np.linalg.qr(columns[:, there] / scale[there], mode="r")
    return np.asarray(there[np.abs(np.diagonal(r)) > tolerance])


def shares_of(kept: FloatArray, columns: FloatArray, tolerance: float) -> FloatArray:
    """Return the shares of independent columns, (rows, kept), in other columns, (kept, columns)."""
    scale, of_others = np.linalg.norm(kept, axis=0), np.linalg.norm(columns, axis=0)
    shares, *_ = np.linalg.lstsq(kept / scale, columns, rcond=None)
    shares[:, of_others <= NOTHING * of_others.max(initial=0.0)] = 0.0
    shares[np.abs(shares) < CERTAIN * tolerance * of_others] = 0.0
    return np.asarray(shares / scale[:, None])


def in_words(terms: Iterable[tuple[int, float]], names: Sequence[str]) -> str:
    """Return a combination of unknowns as text, e.g. `k + 0.0123 k_c`.

    Args:
        terms: index and factor of each unknown; the first factor is 1.
        names: names of all unknowns.
    """
    (first, _), *others = terms
    signed = (
        f" {'-' if factor < 0 else '+'} {_factor_text(abs(factor))}{names[at]}" for at, factor in others
    )
    return "".join((names[first], *signed))


def _factor_text(factor: float) -> str:
    return "" if f"{factor:.4g}" == "1" else f"{factor:.4g} "
