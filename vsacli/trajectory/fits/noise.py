"""How noisy samples are, and what noise does to the derivatives of a spline."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray

INTERPOLATION_GAIN = {7: (1.0, 1.481, 4.628, 6.957, 37.415), 5: (1.0, 1.376, 4.798)}
"""By degree, for each derivative k: standard deviation at the samples, times step^k, of a spline through
equally spaced samples with independent noise of standard deviation 1."""

LEAST_SQUARES_GAIN = {7: (1.0, 1.823, 4.484, 12.11, 34.37), 5: (1.0, 1.829, 4.538)}
"""By degree, for each derivative k: root mean square over a knot span, times span^k sqrt(samples in a span),
of a least-squares spline near many such samples, far from its ends."""


BLOCK_SAMPLES = 16384
"""Samples whose differences are held in memory at a time."""


def estimate(time: FloatArray, rows: FloatArray, order: int) -> FloatArray:
    """Standard deviation of independent noise, from divided differences of the samples.

    A difference of a high order leaves next to nothing of a function that is smooth over a few samples; its
    weights are scaled so that their squares add up to 1.

    Args:
        time: (samples,), s.
        rows: (components, samples).
        order: of the differences.

    Returns:
        (components,), zero if there are too few samples to tell.
    """
    count = len(time) - order
    power = np.zeros(len(rows))
    for start in range(0, count, BLOCK_SAMPLES):
        block = slice(start, start + BLOCK_SAMPLES + order)
        power += np.sum(_differences(time[block], rows[:, block], order) ** 2, axis=1)
    return np.asarray(np.sqrt(power / max(1, count)))


def _differences(time: FloatArray, rows: FloatArray, order: int) -> FloatArray:
    """(components, samples - order)."""
    count = len(time) - order
    nodes = [time[i : i + count] for i in range(order + 1)]
    span = nodes[-1] - nodes[0]
    weights = np.ones((order + 1, count))
    for i, node in enumerate(nodes):
        for other in (*nodes[:i], *nodes[i + 1 :]):
            weights[i] /= (node - other) / span
    weights /= np.sqrt(np.sum(weights**2, axis=0))
    total = np.zeros((len(rows), count))
    for i, weight in enumerate(weights):
        total += weight * rows[:, i : i + count]
    return total
