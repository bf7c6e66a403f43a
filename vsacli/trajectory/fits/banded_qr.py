"""Linear estimation with banded rows in square-root information form, by QR factorization block by block.

`sort_rows` sorts rows into blocks, `factorize` makes the triangular factor, and `Posterior` solves for the
unknowns and their covariances.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray

BLOCK = 12
"""Number of unknowns of a block, and largest width of a row. A row of B-splines of degree 7 has eight
coefficients; the difference of two neighboring rows, at most two spans apart, has more."""


class Rows(NamedTuple):
    """Rows sorted by the block in which they start.

    Attributes:
        blocks: rows of each block, (blocks, most rows of a block, 2 `BLOCK`); unused ones are zero.
        block: index of the block of each row, (rows,).
        place: index of each row in its block, (rows,).
    """

    blocks: FloatArray
    block: IndexArray
    place: IndexArray


class Factor(NamedTuple):
    """The block-bidiagonal triangular factors of several estimations (candidates), and their residuals.

    Attributes:
        diagonal: diagonal blocks, (candidates, blocks, `BLOCK`, `BLOCK`).
        upper: blocks to the right of these, same shape.
        right: transformed right-hand side, (candidates, blocks, `BLOCK`).
        rest: residual sum of squares, (candidates,).
    """

    diagonal: FloatArray
    upper: FloatArray
    right: FloatArray
    rest: FloatArray

    @property
    def log_determinants(self) -> FloatArray:
        """Logarithms of the determinants of the Gram matrices, (candidates,)."""
        pivots = np.abs(np.diagonal(self.diagonal, axis1=2, axis2=3))
        return np.asarray(2 * np.sum(np.log(np.maximum(pivots, np.finfo(float).tiny)), axis=(1, 2)))


def block_count(unknowns: int) -> int:
    """Return the number of blocks that hold this many unknowns."""
    return -(-unknowns // BLOCK)


def sort_rows(first: IndexArray, rows: FloatArray, unknowns: int) -> Rows:
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
    return Rows(blocks, block, place)


def factorize(data: FloatArray, target: FloatArray, prior: FloatArray, weights: FloatArray) -> Factor:
    """Return the triangular factors of data and prior.

    Args:
        data: data rows, (blocks, rows, 2 `BLOCK`).
        target: right-hand side of the data rows, (blocks, rows).
        prior: prior rows, whose right-hand side is zero, (blocks, `BLOCK`, 2 `BLOCK`).
        weights: weights of the prior rows, (candidates, blocks, `BLOCK`).
    """
    candidates, count = weights.shape[:2]
    diagonal = np.empty((candidates, count, BLOCK, BLOCK))
    upper, right, rest = np.empty_like(diagonal), np.empty(diagonal.shape[:3]), np.zeros(candidates)
    work = np.zeros((candidates, 2 * BLOCK + data.shape[1], 2 * BLOCK + 1))
    for k in range(count):
        work[:, BLOCK : 2 * BLOCK, :-1] = weights[:, k, :, None] * prior[k]
        work[:, BLOCK : 2 * BLOCK, -1] = 0
        work[:, 2 * BLOCK :, :-1] = data[k]
        work[:, 2 * BLOCK :, -1] = target[k]
        triangle = _triangle(work)
        diagonal[:, k] = triangle[:, :BLOCK, :BLOCK]
        upper[:, k] = triangle[:, :BLOCK, BLOCK:-1]
        right[:, k] = triangle[:, :BLOCK, -1]
        rest += triangle[:, 2 * BLOCK, -1] ** 2
        work[:, :BLOCK, :BLOCK] = triangle[:, BLOCK : 2 * BLOCK, BLOCK:-1]
        work[:, :BLOCK, BLOCK:-1] = 0
        work[:, :BLOCK, -1] = triangle[:, BLOCK : 2 * BLOCK, -1]
    return Factor(diagonal, upper, right, rest + np.sum(work[:, :BLOCK, -1] ** 2, axis=1))


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
        for k in range(len(diagonal) - 1, -1, -1):
            root = np.hstack([self._inverse[k], passed[k] @ self._roots[k + 1]])
            self._roots[k] = _triangle(root.T).T

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
        """Return variances of values, (blocks, rows), given by rows as in `Rows.blocks`."""
        return np.asarray(np.sum(self.roots_of(blocks) ** 2, axis=2))


def _triangle(rows: FloatArray) -> FloatArray:
    """Return the triangular factor of rows, (..., rows, columns), in half the time of `qr` with mode "r"."""
    from scipy.linalg.lapack import dgeqrf

    if rows.ndim > 2 and len(rows) > 1:
        reflected = np.swapaxes(np.linalg.qr(rows, mode="raw")[0], -1, -2)
    else:  # LAPACK without NumPy's overhead per call
        reflected = dgeqrf(rows.reshape(rows.shape[-2:]))[0].reshape(rows.shape)
    height, width = min(rows.shape[-2:]), rows.shape[-1]
    return np.asarray(reflected[..., :height, :] * _upper(height, width))


@cache
def _upper(height: int, width: int) -> FloatArray:
    return np.triu(np.ones((height, width)))
