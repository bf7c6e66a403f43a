"""Covariance of least squares whose residuals are not white: the sandwich."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.studies.identification.estimation.equations import System
from vsacli.studies.measured.colored_noise import count_of_cosines, covariance_of_sum

LEAST_FREEDOM = 0.01
"""Share of a row's noise that its residual shows at least, 1 less its leverage; below, the row was not fitted
but interpolated, and its residual says nothing."""


def score_covariance(system: System, q: FloatArray, residual: FloatArray) -> FloatArray:
    """Covariance of q^T e, the meat of the sandwich, (columns, columns).

    Scores of one sample are added before anything else, so that noise that groups have in common counts.

    Args:
        system: whose equations they are.
        q: orthonormal columns, (rows, columns).
        residual: of each row, in units of its noise, (rows,).
    """
    freedom = np.maximum(1.0 - np.einsum("rc,rc->r", q, q), LEAST_FREEDOM)
    scores = q * (residual / np.sqrt(freedom))[:, None]
    parts = [
        covariance_of_sum(_by_sample(scores[here], system.group[here], system.sample[here]))[0]
        for here in (system.record == record for record in np.unique(system.record))
    ]
    return np.asarray(wider(freedom_of(system)) * sum(parts))


def freedom_of(system: System) -> int:
    """Return from how many cosines the covariance is taken: its degrees of freedom."""
    samples = [system.sample[system.record == record] for record in np.unique(system.record)]
    return sum(count_of_cosines(int(np.ptp(each)) + 1) for each in samples)


def wider(freedom: int) -> float:
    """Return the variance of Student's t: so few cosines tell the covariance but roughly."""
    return freedom / max(freedom - 2, 1)


def _by_sample(scores: FloatArray, group: IndexArray, sample: IndexArray) -> FloatArray:
    """Sums over the rows of each sample of a record, (samples, columns); zero where there are none."""
    first = sample.min()
    summed = np.zeros((int(sample.max() - first) + 1, scores.shape[1]))
    for each in np.unique(group):
        rows = group == each
        summed[sample[rows] - first] += scores[rows]
    return summed
