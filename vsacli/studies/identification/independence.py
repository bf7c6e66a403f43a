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

ZERO_NORM_RATIO = 1e-13
"""Ratio of a column's norm to the largest norm up to which the column is rounding."""

MIN_NOISE_RATIO = 4.0
"""Ratio of a column's independent part to its noise above which it is independent: below, more than a
sixteenth of its square is noise, and its unknown comes out too small by that share."""

MIN_SHARE_RATIO = 10.0
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
    nonzero = np.flatnonzero(scale > ZERO_NORM_RATIO * scale.max(initial=0.0))
    scaled = columns[:, nonzero] / scale[nonzero]
    scaled_noise = np.zeros_like(scaled) if noise is None else noise[:, nonzero] / scale[nonzero]
    triangle, scaled_noise = (np.asarray(np.linalg.qr(each, mode="r")) for each in (scaled, scaled_noise))
    pivot_order = _pivot_order(triangle, scaled_noise, tolerance)
    kept, dropped = nonzero[pivot_order], np.setdiff1d(nonzero, nonzero[pivot_order])
    q, r = np.linalg.qr(scaled[:, pivot_order])
    dependent = np.setdiff1d(np.arange(len(nonzero)), pivot_order)
    shares = scipy.linalg.solve_triangular(r, q.T @ scaled[:, dependent])
    shares[np.abs(shares) < MIN_SHARE_RATIO * tolerance] = 0.0
    return Independence(
        kept=kept,
        dropped=dropped,
        nothing=np.setdiff1d(np.arange(len(scale)), nonzero),
        shares=shares * scale[dropped] / scale[kept][:, None],
        scale=scale,
        q=q,
        r=r,
        condition=float(np.linalg.cond(triangle)) if nonzero.size else 1.0,
    )


def _pivot_order(triangle: FloatArray, noise: FloatArray, tolerance: float) -> list[int]:
    """Return indices of the independent columns, in the order of pivoting.

    Args:
        triangle: columns of unit norm, reduced to few rows by QR.
        noise: noise of the columns, reduced by QR; each elimination is applied to it as well.
        tolerance: see `independence`.
    """
    remainder, noise = triangle.copy(), noise.copy()
    candidates, kept = list(range(remainder.shape[1])), []
    while candidates:
        norms = np.linalg.norm(remainder[:, candidates], axis=0)
        largest_index = int(np.argmax(np.round(norms, 9)))
        pivot = candidates.pop(largest_index)
        pivot_norm = float(np.max(norms))
        if pivot_norm > max(tolerance, MIN_NOISE_RATIO * float(np.linalg.norm(noise[:, pivot]))):
            share = remainder[:, pivot] @ remainder[:, candidates] / pivot_norm**2
            remainder[:, candidates] -= np.outer(remainder[:, pivot], share)
            noise[:, candidates] -= np.outer(noise[:, pivot], share)
            kept.append(pivot)
    return kept


def first_independent(columns: FloatArray, tolerance: float) -> IndexArray:
    """Return indices of the columns that are not combinations of previous columns; see `independence`."""
    scale = np.linalg.norm(columns, axis=0)
    nonzero = np.flatnonzero(scale > ZERO_NORM_RATIO * scale.max(initial=0.0))
    r = np.linalg.qr(columns[:, nonzero] / scale[nonzero], mode="r")
    return np.asarray(nonzero[np.abs(np.diagonal(r)) > tolerance])


def shares_of(kept: FloatArray, columns: FloatArray, tolerance: float) -> FloatArray:
    """Return the shares of independent columns, (rows, kept), in other columns, (kept, columns)."""
    scale, column_norms = np.linalg.norm(kept, axis=0), np.linalg.norm(columns, axis=0)
    shares, *_ = np.linalg.lstsq(kept / scale, columns, rcond=None)
    shares[:, column_norms <= ZERO_NORM_RATIO * column_norms.max(initial=0.0)] = 0.0
    shares[np.abs(shares) < MIN_SHARE_RATIO * tolerance * column_norms] = 0.0
    return np.asarray(shares / scale[:, None])


def in_words(terms: Iterable[tuple[int, float]], names: Sequence[str]) -> str:
    """Return a combination of unknowns as text, e.g. `k + 0.0123 k_c`.

    Args:
        terms: index and factor of each unknown; the first factor is 1.
        names: names of all unknowns.
    """
    (first, _), *other_terms = terms
    signed_terms = (
        f" {'-' if factor < 0 else '+'} {_factor_text(abs(factor))}{names[index]}"
        for index, factor in other_terms
    )
    return "".join((names[first], *signed_terms))


def _factor_text(factor: float) -> str:
    return "" if f"{factor:.4g}" == "1" else f"{factor:.4g} "
