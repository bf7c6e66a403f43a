"""The resolution of a column of samples: quantum of its numbers, and changes beyond it and its noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.recorded.thresholds import BLOCK, NOISE_DEVIATIONS, QUANTA

ORDER = 4
NORMAL_MEDIAN = 0.6745
"""Median of |x| for a standard normal distribution."""

ROUNDING = 8 * np.finfo(float).eps
"""Share of the largest value below which changes count as rounding of equal values."""

FINEST = 0.01
"""Quantile of second differences that counts as the step of an encoder; smaller ones may be accidental."""

UNRESOLVED = 1e-8
"""Share of the largest value that neither sensors nor single-precision numbers resolve. Computed columns,
such as profiles of fixes, have solver errors of a fifth of it."""

CHUNK = 1024 * BLOCK
"""Number of samples whose differences are computed at a time."""


@dataclass(frozen=True, eq=False)
class Quantization:
    """Quantization and noise of a column.

    Attributes:
        differences: divided differences of fourth order, (samples - 4,), scaled so that noise keeps its
            standard deviation; a motion that is sampled fast enough contributes little.
        quantum: step of the numbers, of an encoder or of printed digits.
        noise: standard deviation near each `BLOCK` of differences, (blocks,).
        noticeable: smallest changes that exceed noise and quantum near each sample, (samples,).
    """

    differences: FloatArray
    quantum: float
    noise: FloatArray
    noticeable: FloatArray

    @classmethod
    def of(cls, time: FloatArray, values: FloatArray) -> Quantization:
        """Return the resolution of a column with more than four samples, (samples,)."""
        differences, quantum = _divided_differences(time, values), _quantum(values)
        blocks = np.maximum(np.arange(len(values)) - ORDER // 2, 0) // BLOCK
        noise = _noise_of_blocks(differences)
        near = noise[np.minimum(blocks, len(noise) - 1)]
        return cls(differences, quantum, noise, np.maximum(NOISE_DEVIATIONS * near, QUANTA * quantum))


def _noise_of_blocks(differences: FloatArray) -> FloatArray:
    """Return the standard deviation near each `BLOCK` of differences, (blocks,).

    Outliers do not change the medians. The largest of three blocks counts, since noise may begin with a
    motion.
    """
    whole = len(differences) // BLOCK * BLOCK
    rows = differences[:whole].reshape(-1, BLOCK) if whole else differences[None]
    near = np.pad(np.median(np.abs(rows), axis=1) / NORMAL_MEDIAN, 1, mode="edge")
    return np.maximum(np.maximum(near[:-2], near[1:-1]), near[2:])


def _divided_differences(time: FloatArray, values: FloatArray) -> FloatArray:
    """Return divided differences; computed in chunks, since the weights need the memory of five columns."""
    count = len(values) - ORDER
    differences = np.empty(count)
    for start in range(0, count, CHUNK):
        stop = min(start + CHUNK, count)
        nodes = [time[start + i : stop + i] for i in range(ORDER + 1)]
        span = nodes[-1] - nodes[0]
        total, size = np.zeros(stop - start), np.zeros(stop - start)
        for i, node in enumerate(nodes):
            weight = np.ones(stop - start)
            for other_node in (*nodes[:i], *nodes[i + 1 :]):
                weight *= span / (node - other_node)
            total += weight * values[start + i : stop + i]
            size += weight**2
        differences[start:stop] = total / np.sqrt(size)
    return differences


def _quantum(values: FloatArray) -> float:
    """Return the smallest typical change between samples above rounding and the resolution of sensors."""
    largest = float(np.abs(values).max())
    changes = np.abs(np.diff(values, n=2))
    changes = changes[changes > ROUNDING * largest]
    place = int(FINEST * len(changes))
    change = float(np.partition(changes, place)[place]) if len(changes) else 0.0
    return max(change, UNRESOLVED * largest)
