"""How far the coefficients of a spline may be off together, and its derivatives with them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.trajectory.fits.information import BLOCK, Posterior, block_count
from vsacli.trajectory.fits.least_squares import normal_equations

BLOCK_SAMPLES = 4096
"""Times whose covariances are computed together: each takes some 5 kB meanwhile."""


class LocalBasis(NamedTuple):
    """The B-splines that are not zero at some times, and their derivatives.

    Attributes:
        first: index of the first of them, (times,).
        rows: (times, orders, degree + 1).
    """

    first: IndexArray
    rows: FloatArray


def local_basis(knots: FloatArray, degree: int, time: FloatArray, orders: int) -> LocalBasis:
    """The B-splines at some times: recurrence of Cox and de Boor, for derivatives that of their coefficients.

    Args:
        knots: all of the spline, those beyond both ends included, s.
        degree: of the spline.
        time: (times,) of its span, s.
        orders: value and derivatives, per s^k.
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
    """Covariances of value and derivatives at some times, (orders, orders, times).

    Args:
        posterior: of the coefficients.
        basis: what the derivatives make of them.
    """
    times, orders, width = basis.rows.shape
    found = np.empty((orders, orders, times))
    for start in range(0, times, BLOCK_SAMPLES):
        chosen = slice(start, start + BLOCK_SAMPLES)
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
    """What samples with independent errors of deviation 1 say of the coefficients of a spline: (X'X)^-1.

    Args:
        time: (samples,), s.
        knots: of the spline, s.
        degree: of the spline.

    Raises:
        LinAlgError: very uneven times leave coefficients that no sample determines.
    """
    from scipy.linalg import cholesky_banded

    bands, _ = normal_equations(time, np.empty((0, len(time))), knots, degree)
    bands = cholesky_banded(bands, lower=True)
    unknowns = bands.shape[1]
    count = block_count(unknowns)
    filled = np.zeros((degree + 1, count * BLOCK))
    filled[0] = 1  # what fills up the last block is known
    filled[:, :unknowns] = bands
    rows, within = np.zeros((count, BLOCK, 2 * BLOCK)), np.arange(BLOCK)
    for distance, band in enumerate(filled):
        rows[:, within, within + distance] = band.reshape(count, BLOCK)
    return Posterior(rows[:, :, :BLOCK], rows[:, :, BLOCK:])
