"""Covariance of least squares whose residuals are not white: the sandwich, by the scores' lowest frequencies.

What noise of any colour does to the unknowns is what the scores, slope times residual, have at frequency 0.
Autocovariances weighted by lag (W. K. Newey, K. D. West, Econometrica 55 (1987)) smear that over a wide band,
and derivatives of noise have much more there: errors came out 2 to 30 times too large. A few cosines do not:
E. Lazarus, D. J. Lewis, J. H. Stock, M. W. Watson, "HAR inference: recommendations for practice", Journal of
Business & Economic Statistics 36 (2018), section 3. Of white residuals it is the usual covariance.
"""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.studies.identification.estimation.equations import System

COSINES = 24
"""Cosines of a record that count. With 8 the errors themselves were too uncertain (87 % within two of them);
with 80, of 3000 samples, those of pure derivatives of noise came out 5 times too large."""

SAMPLES_A_COSINE = 4
"""At least, so that of short records the cosines remain the lowest ones."""

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
        _of_record(_by_sample(scores[here], system.group[here], system.sample[here]))
        for here in (system.record == record for record in np.unique(system.record))
    ]
    drawn = sum(cosines for _, cosines in parts)
    wider = drawn / max(drawn - 2, 1)  # variance of Student's t: so few cosines tell the covariance roughly
    return np.asarray(wider * sum(covariance for covariance, _ in parts))


def _by_sample(scores: FloatArray, group: IndexArray, sample: IndexArray) -> FloatArray:
    """Sums over the rows of each sample of a record, (samples, columns); zero where there are none."""
    first = sample.min()
    summed = np.zeros((int(sample.max() - first) + 1, scores.shape[1]))
    for each in np.unique(group):
        rows = group == each
        summed[sample[rows] - first] += scores[rows]
    return summed


def _of_record(scores: FloatArray) -> tuple[FloatArray, int]:
    """Covariance of the sum of the scores, (columns, columns), and from how many cosines it was taken."""
    from scipy.fft import dct

    count = min(COSINES, -(-len(scores) // SAMPLES_A_COSINE))
    amplitudes = dct(scores, axis=0, norm="ortho")[1 : count + 1]
    return len(scores) / len(amplitudes) * amplitudes.T @ amplitudes, len(amplitudes)
