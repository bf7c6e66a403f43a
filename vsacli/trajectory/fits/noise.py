"""What divided differences of samples say about noise, before anything is fitted.

A difference of a high order leaves next to nothing of a function that is smooth over a few samples. Its
weights are scaled so that their squares add up to 1: independent noise keeps its standard deviation.
"""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray

BLOCK_SAMPLES = 16384
"""Samples whose differences are held in memory at a time."""

PROBES = 4096
"""Differences at each stride that a median is taken of."""

ABOVE_FLOOR = 10.0
"""Factor above the differences of neighbouring samples from which on noise is not white. Below it
interpolation knows the noise well enough. Of computed samples the factor was up to 3 before motion began to
show, of noise that was low-pass filtered at 50 Hz or less 10^3 and more."""

BELOW_MOTION = 30.0
"""Factor below the largest differences of any stride beyond which differences are motion: those at strides
as long as its fastest parts grow slowly, too."""

SLOW_GROWTH = 8.0
"""Factor of differences from one stride to twice that, below which they are noise. Of 6 motions x 12 seeds at
4 rates it was 9 and more, mostly 2^8; of filtered noise at some stride below 5."""

ROUNDING = 10 * np.finfo(float).eps
"""Of the largest value; differences below are what arithmetic leaves."""


AT_REST = 1e-6
"""Share of a record's deviation within which samples rest. An encoder at rest has no noise, and may rest
most of the time."""


def estimated_noise(time: FloatArray, rows: FloatArray, order: int) -> FloatArray:
    """Standard deviation of independent noise.

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
        first = np.arange(start, min(count, start + BLOCK_SAMPLES))
        power += np.sum(_differences(time, rows, order, first, 1) ** 2, axis=1)
    return np.asarray(np.sqrt(power / max(1, count)))


def filtered_noise(time: FloatArray, rows: FloatArray, order: int) -> BoolArray:
    """Whether there is noise that neighbouring samples hardly show, since a filter took it, (components,).

    Differences of every second, fourth, ... sample grow by 2^order each time as long as motion is smooth over
    so many samples, those of filtered noise by less and less.

    Args:
        time: (samples,), s.
        rows: (components, samples).
        order: of the differences.
    """
    if len(time) <= order:
        return np.zeros(len(rows), dtype=bool)
    sizes = np.array([_typical(time, rows, order, stride) for stride in _strides(len(time), order)])
    least = ABOVE_FLOOR * np.maximum(sizes[0], ROUNDING * np.abs(rows).max(axis=1))
    between = (sizes > least) & (sizes < sizes.max(axis=0) / BELOW_MOTION)
    found: BoolArray = np.any(between[:-1] & (sizes[1:] < SLOW_GROWTH * sizes[:-1]), axis=0)
    return found


def typical_noise(time: FloatArray, rows: FloatArray, order: int) -> FloatArray:
    """Standard deviation of independent noise in most places, (components,), whatever motion jumps in others.

    Args:
        time: (samples,), s.
        rows: (components, samples).
        order: of the differences.
    """
    return _typical(time, rows, order, 1) if len(time) > order else np.zeros(len(rows))


def _strides(samples: int, order: int) -> list[int]:
    """Powers of two as long as three such differences fit into the record side by side."""
    return [2**power for power in range(max(1, (samples // (3 * order)).bit_length()))]


def _typical(time: FloatArray, rows: FloatArray, order: int, stride: int) -> FloatArray:
    """The standard deviation of normal differences with the same median, while moving, (components,)."""
    last = len(time) - 1 - order * stride
    first = np.unique(np.linspace(0, last, min(PROBES, last + 1)).astype(int))
    sizes = np.abs(_differences(time, rows, order, first, stride))
    nodes = rows[:, first + stride * np.arange(order + 1)[:, None]]
    moving = np.ptp(nodes, axis=1) > AT_REST * np.std(rows, axis=1, keepdims=True)
    medians = [np.median(size[of]) if of.any() else 0.0 for size, of in zip(sizes, moving, strict=True)]
    return np.array(medians) / 0.6745


def _differences(
    time: FloatArray, rows: FloatArray, order: int, first: IndexArray, stride: int
) -> FloatArray:
    """Of samples `stride` apart, the first of each given by its index, (components, differences)."""
    nodes = [time[first + i * stride] for i in range(order + 1)]
    span = nodes[-1] - nodes[0]
    weights = np.ones((order + 1, len(first)))
    for i, node in enumerate(nodes):
        for other in (*nodes[:i], *nodes[i + 1 :]):
            weights[i] /= (node - other) / span
    weights /= np.sqrt(np.sum(weights**2, axis=0))
    total = np.zeros((len(rows), len(first)))
    for i, weight in enumerate(weights):
        total += weight * rows[:, first + i * stride]
    return total
