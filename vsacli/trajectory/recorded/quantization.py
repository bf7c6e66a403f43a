"""The resolution of a column of samples: quantum of its numbers, and noise near each sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.trajectory.recorded.thresholds import BLOCK

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
        noise: standard deviation near each `BLOCK` of differences, (blocks,), by medians, which outliers do
            not change; the largest of three blocks, since noise may begin with a motion.
    """

    differences: FloatArray
    quantum: float
    noise: FloatArray

    @classmethod
    def of(cls, time: FloatArray, values: FloatArray) -> Quantization:
        """Return the resolution of a column with more than four samples, (samples,)."""
        differences = _divided_differences(time, values)
        whole = len(differences) // BLOCK * BLOCK
        rows = differences[:whole].reshape(-1, BLOCK) if whole else differences[None]
        near = np.pad(np.median(np.abs(rows), axis=1) / NORMAL_MEDIAN, 1, mode="edge")
        noise = np.maximum(np.maximum(near[:-2], near[1:-1]), near[2:])
        return cls(differences, _quantum(values), noise)

    def noise_at(self, samples: IndexArray) -> FloatArray:
        """Return the standard deviation of the noise near samples."""
        blocks = np.maximum(samples - ORDER // 2, 0) // BLOCK
        return np.asarray(self.noise[np.minimum(blocks, len(self.noise) - 1)])


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
