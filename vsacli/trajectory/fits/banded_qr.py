"""Linear estimation with banded rows in square-root information form, by QR factorization block by block.

`sort_rows` sorts rows into blocks, `factorize` makes the triangular factor, and `Posterior` solves for the
unknowns and their covariances.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray, IndexArray

BLOCK = 12
"""Number of unknowns of a block, and largest width of a row. A row of B-splines of degree 7 has eight
coefficients; the difference of two neighboring rows, at most two spans apart, has more."""

LOWER = np.tri(BLOCK)
"""Mask of the lower triangle of a block."""


class BandedRows(NamedTuple):
    """Rows sorted by the block in which they start.

    Attributes:
        blocks: rows of each block, (blocks, most rows of a block, 2 `BLOCK`); unused ones are zero.
        block: index of the block of each row, (rows,).
        place: index of each row in its block, (rows,).
    """

    blocks: FloatArray
    block: IndexArray
    place: IndexArray


class BandedFactor(NamedTuple):
    """A block-bidiagonal triangular factor, and its residual.

    Attributes:
        diagonal: diagonal blocks, (blocks, `BLOCK`, `BLOCK`).
        upper: blocks to the right of these, same shape.
        right: transformed right-hand side, (blocks, `BLOCK`).
        rest: residual sum of squares.
    """

    diagonal: FloatArray
    upper: FloatArray
    right: FloatArray
    rest: float

    @property
    def rows(self) -> FloatArray:
        """Rows that say the same as those factorized, (blocks, `BLOCK`, 2 `BLOCK`), see `BandedRows`."""
        return np.concatenate([self.diagonal, self.upper], axis=2)

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant of the Gram matrix."""
        pivots = np.abs(np.diagonal(self.diagonal, axis1=1, axis2=2))
        return 2 * float(np.sum(np.log(np.maximum(pivots, np.finfo(float).tiny))))


def block_count(unknowns: int) -> int:
    """Return the number of blocks that hold this many unknowns."""
    return -(-unknowns // BLOCK)


def sort_rows(first: IndexArray, rows: FloatArray, unknowns: int) -> BandedRows:
    """Sort rows into blocks.

    Args:
        first: index of the first unknown of each row, (rows,), non-decreasing.
        rows: rows, (rows, width), at most `BLOCK` wide.
        unknowns: number of unknowns.
    """
    block = first // BLOCK
    place = np.arange(len(first)) - np.searchsorted(block, block)
    count = block_count(unknowns)
    blocks = np.zeros((count, int(place.max()) + 1, 2 * BLOCK))
    columns = (first - block * BLOCK)[:, None] + np.arange(rows.shape[1])
    blocks[block[:, None], place[:, None], columns] = rows
    return BandedRows(blocks, block, place)


def factorize(rows: FloatArray, target: FloatArray) -> BandedFactor:
    """Return the triangular factor of rows.

    Args:
        rows: rows, (blocks, rows, 2 `BLOCK`).
        target: right-hand side, (blocks, rows).
    """
    count, height = target.shape
    # Columns lie one after the other, as LAPACK overwrites them; the first rows come from the block before.
    work = np.zeros((count + 1, 2 * BLOCK + 1, max(BLOCK + height, 2 * BLOCK + 1)))
    work[:-1, :-1, BLOCK : BLOCK + height] = np.swapaxes(rows, 1, 2)
    work[:-1, -1, BLOCK : BLOCK + height] = target
    for block, following in pairwise(work):
        scipy.linalg.lapack.dgeqrf(block.T, overwrite_a=True)
        np.multiply(block[BLOCK:-1, BLOCK : 2 * BLOCK], LOWER, out=following[:BLOCK, :BLOCK])
        following[-1, :BLOCK] = block[-1, BLOCK : 2 * BLOCK]
    triangle = np.swapaxes(work[:-1], 1, 2)
    rest = np.sum(triangle[:, 2 * BLOCK, -1] ** 2) + np.sum(work[-1, -1, :BLOCK] ** 2)
    diagonal, upper = LOWER.T * triangle[:, :BLOCK, :BLOCK], triangle[:, :BLOCK, BLOCK:-1].copy()
    return BandedFactor(diagonal, upper, triangle[:, :BLOCK, -1].copy(), float(rest))


class Posterior:
    """The posterior of an estimation, in units of the standard deviation of a data row."""

    def __init__(self, diagonal: FloatArray, upper: FloatArray) -> None:
        """Invert a triangular factor of the inverse covariance.

        Args:
            diagonal: diagonal blocks of the factor, (blocks, `BLOCK`, `BLOCK`).
            upper: blocks to the right of these, same shape.
        """
        self._inverse, self._upper = np.linalg.inv(diagonal), upper
        self._roots = np.zeros((len(diagonal) + 1, BLOCK, BLOCK))
        """Square roots of the covariances of the blocks; zero after the last."""
        passed = -self._inverse @ upper
        roots = np.concatenate([self._inverse, passed], axis=2)
        for k in range(len(diagonal) - 1, -1, -1):
            roots[k, :, BLOCK:] = passed[k] @ self._roots[k + 1]
            scipy.linalg.lapack.dgeqrf(roots[k].T, overwrite_a=True)
            np.multiply(roots[k, :, :BLOCK], LOWER, out=self._roots[k])

    def unknowns(self, right: FloatArray) -> FloatArray:
        """Return the most probable values of the unknowns.

        Args:
            right: transformed right-hand side, (blocks, `BLOCK`).
        """
        values = np.zeros((len(right) + 1, BLOCK))
        for k in range(len(right) - 1, -1, -1):
            values[k] = self._inverse[k] @ (right[k] - self._upper[k] @ values[k + 1])
        return values[:-1].ravel()

    def roots_of(self, rows: FloatArray, block: IndexArray | slice = slice(None)) -> FloatArray:
        """Return square roots of the covariances of values given by rows, (..., rows, 2 `BLOCK`).

        Args:
            rows: rows, (..., rows, 2 `BLOCK`).
            block: index of the block in which they start, (...,); by default all blocks in order.
        """
        near = rows[..., :BLOCK] @ self._inverse[block]
        far = (rows[..., BLOCK:] - near @ self._upper[block]) @ self._roots[1:][block]
        return np.concatenate([near, far], axis=-1)

    def variances(self, blocks: FloatArray) -> FloatArray:
        """Return variances of values, (blocks, rows), given by rows as in `BandedRows.blocks`."""
        return np.asarray(np.sum(self.roots_of(blocks) ** 2, axis=2))
