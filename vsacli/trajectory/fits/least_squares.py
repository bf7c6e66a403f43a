"""Least-squares splines, and linear estimation with banded rows in square-root information form.

`sort_rows` sorts rows into blocks, `factorize` makes the triangular factor by QR factorization of each block,
and `Posterior` solves for the unknowns and their covariances. The number of knots of a spline is chosen by
generalized cross-validation.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray, IndexArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


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


PENALTY = 1.4
"""Weight of a coefficient in cross-validation.

With weight 1 it sometimes selects far too many knots (Kim & Gu, 2004); twice as many mean 2^4.5 times the
noise in a fourth derivative.
"""

BLOCK_SAMPLES = 16384
"""Samples whose B-splines are held in memory at a time."""

COARSE_RATIO = 4
"""Ratio of successive numbers of spans in the first search, over the whole range: the score may have several
minima, one for each time scale of the motion."""

FINE_RATIOS = (2.0, 2.0**0.5, 2.0**0.25)
"""Ratios of the numbers tried next on both sides of the best; the last is finer than the minimum is sharp."""


def most_spans(samples: int, degree: int) -> int:
    """Return the largest number of spans, with half as many coefficients as samples; the rest shows noise."""
    return max(1, samples // 2 - degree)


def fit_spline(time: FloatArray, rows: FloatArray, spans: int, degree: int) -> BSpline[np.float64]:
    """Return the least-squares spline of samples, with equal numbers of samples in all knot spans.

    The banded normal equations are solved once more for the residual, which restores the digits lost by
    squaring the condition number (corrected seminormal equations, Björck, Numerical Methods for Least Squares
    Problems, 1996, 6.6.5). This takes a fraction of the time of SciPy's `make_lsq_spline`, which grows with
    the product of samples and knots.

    Args:
        time: times, (samples,), s.
        rows: values, (components, samples).
        spans: number of knot spans.
        degree: degree of the spline.
    """
    try:
        first = _solve(time, rows, spans, degree)
        correction = _solve(time, rows - first(time).T, spans, degree)
    except np.linalg.LinAlgError:  # very uneven times
        return scipy.interpolate.make_lsq_spline(
            time, rows.T, _knots(time, spans, degree), k=degree, method="qr"
        )
    return type(first)(first.t, first.c + correction.c, degree)


def best_spans(time: FloatArray, rows: FloatArray, degree: int) -> IndexArray:
    """Return the number of knot spans for each row, by generalized cross-validation (Craven & Wahba, 1979).

    It minimizes RSS / (1 - 1.4 coefficients/samples)^2, see `PENALTY`. The number is chosen for each row:
    with a common knot spacing, noise of a slow joint would pass through the knots of the fastest. Of
    successive equal samples, as from an encoder of low resolution, only one counts: their errors are not
    independent, and a score that assumed so would follow the steps.

    Returns:
        Numbers of spans, (components,); `most_spans` if more, up to interpolation, would be better.
    """
    limit = most_spans(len(time), degree)
    informative = 1 + np.count_nonzero(np.diff(rows), axis=1)
    scores: dict[int, FloatArray] = {}

    def best(candidates: set[int]) -> IndexArray:
        for spans in candidates - scores.keys():
            scores[spans] = _score(time, rows, informative, spans, degree)
        counts = np.array(sorted(scores))
        return np.asarray(counts[np.argmin([scores[count] for count in counts.tolist()], axis=0)])

    powers = range(int(np.log(limit) / np.log(COARSE_RATIO) + 1e-9) + 1)
    chosen = best({limit, *(COARSE_RATIO**power for power in powers)})
    for ratio in FINE_RATIOS:
        near = np.concatenate([chosen / ratio, chosen * ratio]).round().astype(int)
        chosen = best(set(np.clip(near, 1, limit).tolist()))
    return chosen


def _score(
    time: FloatArray, rows: FloatArray, informative: IndexArray, spans: int, degree: int
) -> FloatArray:
    """Return the scores, (components,).

    A score is infinite if there are more coefficients than half of the informative samples, or if very uneven
    times leave spans whose samples coincide up to rounding.
    """
    share = (spans + degree) / informative
    if np.all(share > 0.5):
        return np.full(len(rows), np.inf)
    try:
        error = rows - _solve(time, rows, spans, degree)(time).T
    except np.linalg.LinAlgError:
        return np.full(len(rows), np.inf)
    return np.where(share > 0.5, np.inf, np.sum(error**2, axis=1) / (1 - PENALTY * share) ** 2)


def _solve(time: FloatArray, rows: FloatArray, spans: int, degree: int) -> BSpline[np.float64]:
    knots = _knots(time, spans, degree)
    bands, sums = normal_equations(time, rows, knots, degree)
    return scipy.interpolate.BSpline(knots, scipy.linalg.solveh_banded(bands, sums, lower=True), degree)


def normal_equations(
    time: FloatArray, rows: FloatArray, knots: FloatArray, degree: int
) -> tuple[FloatArray, FloatArray]:
    """Return the normal equations of the least-squares spline of samples.

    Args:
        time: times, (samples,), s.
        rows: values, (components, samples).
        knots: knots of the spline, s.
        degree: degree of the spline.

    Returns:
        Lower bands of the Gram matrix, (degree + 1, coefficients); right-hand sides, (coefficients,
        components).
    """
    coefficients = len(knots) - degree - 1
    bands, sums = np.zeros((degree + 1, coefficients)), np.zeros((coefficients, len(rows)))
    for start in range(0, len(time), BLOCK_SAMPLES):
        stop = start + BLOCK_SAMPLES
        _add(bands, sums, time[start:stop], rows[:, start:stop], knots)
    return bands, sums


def _knots(time: FloatArray, spans: int, degree: int) -> FloatArray:
    """Return knots equally spaced by the number of samples, so that no span is empty."""
    inner = np.interp(np.linspace(0, len(time) - 1, spans + 1), np.arange(len(time)), time)
    return np.concatenate([np.repeat(time[0], degree), inner, np.repeat(time[-1], degree)])


def _add(bands: FloatArray, sums: FloatArray, time: FloatArray, rows: FloatArray, knots: FloatArray) -> None:
    """Add a block of samples to the lower bands and right-hand sides of the normal equations."""
    width = len(bands)
    # Extrapolation skips a slow check of the span.
    design = scipy.interpolate.BSpline.design_matrix(time, knots, width - 1, extrapolate=True)
    basis = np.ascontiguousarray(design.data.reshape(-1, width).T)
    first = design.indices[::width]
    starts = np.flatnonzero(np.diff(first, prepend=-1))
    columns = first[starts]
    for i in range(width):
        sums[columns + i] += np.add.reduceat(basis[i] * rows, starts, axis=1).T
        for j in range(i, width):
            bands[j - i, columns + i] += np.add.reduceat(basis[i] * basis[j], starts)


COVARIANCE_BLOCK = 4096
"""Times whose covariances are computed together; each needs about 5 kB."""


class LocalBasis(NamedTuple):
    """The B-splines that are nonzero at given times, and their derivatives.

    Attributes:
        first: index of the first nonzero B-spline, (times,).
        rows: values and derivatives, (times, orders, degree + 1).
    """

    first: IndexArray
    rows: FloatArray


def local_basis(knots: FloatArray, degree: int, time: FloatArray, orders: int) -> LocalBasis:
    """Return B-splines and their derivatives at times, by the Cox-de Boor recurrence.

    Args:
        knots: all knots of the spline, those beyond both ends included, s.
        degree: degree of the spline.
        time: times of its span, (times,), s.
        orders: number of functions, value and derivatives, per s^k.
    """
    last = len(knots) - degree - 2
    place = np.clip(np.searchsorted(knots, time, side="right") - 1, degree, last)
    values, weights = [np.ones((len(time), 1))], [np.empty(0)]
    for k in range(1, degree + 1):
        left = knots[place[:, None] + np.arange(1 - k, 1)]
        right = knots[place[:, None] + np.arange(1, k + 1)]
        weights.append(1 / (right - left))
        share = values[-1] * weights[k]
        higher = np.zeros((len(time), k + 1))
        higher[:, 1:] += (time[:, None] - left) * share
        higher[:, :-1] += (right - time[:, None]) * share
        values.append(higher)
    rows = np.empty((len(time), orders, degree + 1))
    for order in range(orders):
        row = values[degree - order]
        for k in range(degree - order + 1, degree + 1):
            row = -k * np.diff(row * weights[k], axis=1, prepend=0, append=0)
        rows[:, order] = row
    return LocalBasis(place - degree, rows)


def of_derivatives(posterior: Posterior, basis: LocalBasis) -> FloatArray:
    """Return covariances of value and derivatives at given times, (orders, orders, times).

    Args:
        posterior: posterior of the coefficients.
        basis: B-splines and their derivatives at the times.
    """
    times, orders, width = basis.rows.shape
    found = np.empty((orders, orders, times))
    for start in range(0, times, COVARIANCE_BLOCK):
        chosen = slice(start, start + COVARIANCE_BLOCK)
        first = basis.first[chosen]
        rows = np.zeros((len(first), orders, 2 * BLOCK))
        columns = (first % BLOCK)[:, None, None] + np.arange(width)
        np.put_along_axis(
            rows, np.broadcast_to(columns, basis.rows[chosen].shape), basis.rows[chosen], axis=2
        )
        roots = posterior.roots_of(rows, first // BLOCK)
        found[:, :, chosen] = np.moveaxis(roots @ np.swapaxes(roots, 1, 2), 0, 2)
    return found


def of_least_squares(time: FloatArray, knots: FloatArray, degree: int) -> Posterior:
    """Return the posterior (X'X)^-1 of the coefficients from samples with independent errors of deviation 1.

    Args:
        time: times, (samples,), s.
        knots: knots of the spline, s.
        degree: degree of the spline.

    Raises:
        LinAlgError: very uneven times leave coefficients that no sample determines.
    """
    bands, _ = normal_equations(time, np.empty((0, len(time))), knots, degree)
    bands = scipy.linalg.cholesky_banded(bands, lower=True)
    unknowns = bands.shape[1]
    count = block_count(unknowns)
    filled = np.zeros((degree + 1, count * BLOCK))
    filled[0] = 1  # unit pivots for the unknowns that fill up the last block
    filled[:, :unknowns] = bands
    rows, within = np.zeros((count, BLOCK, 2 * BLOCK)), np.arange(BLOCK)
    for distance, band in enumerate(filled):
        rows[:, within, within + distance] = band.reshape(count, BLOCK)
    return Posterior(rows[:, :, :BLOCK], rows[:, :, BLOCK:])
