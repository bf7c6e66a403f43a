"""Linear equations of arrays of numbers or symbols, by a factorisation of fixed size."""

from __future__ import annotations

import math
from functools import reduce
from typing import Any

import numpy as np


def solve_positive_definite(matrix: Any, right: Any, smallest_pivot: float) -> Any:
    """matrix^-1 right, by L D L^T without pivoting; NaN where the matrix is not positive definite.

    Args:
        matrix: (n, n), symmetric.
        right: (n,).
        smallest_pivot: relative to the diagonal entry, below which a pivot of D counts as not positive.
    """
    size = len(right)
    lower: dict[tuple[int, int], Any] = {}
    pivots: list[Any] = []
    for column in range(size):
        scaled = {inner: lower[column, inner] * pivots[inner] for inner in range(column)}
        pivot = _less(
            matrix[column, column], [lower[column, inner] * scaled[inner] for inner in range(column)]
        )
        regular = pivot > smallest_pivot * matrix[column, column]
        pivots.append(np.where(regular, pivot, math.nan))
        for row in range(column + 1, size):
            products = [lower[row, inner] * scaled[inner] for inner in range(column)]
            lower[row, column] = _less(matrix[row, column], products) / pivots[column]

    forward: list[Any] = []
    for row in range(size):
        forward.append(_less(right[row], [lower[row, inner] * forward[inner] for inner in range(row)]))
    solution: dict[int, Any] = {}
    for row in reversed(range(size)):
        known = [lower[below, row] * solution[below] for below in range(row + 1, size)]
        solution[row] = _less(forward[row] / pivots[row], known)
    return np.stack([solution[row] for row in range(size)])


def _less(value: Any, terms: list[Any]) -> Any:
    return reduce(lambda rest, term: rest - term, terms, value)
