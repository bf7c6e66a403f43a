"""The resolution beyond which a recording is noise alone, so that no finer one can show a motion.

A motion whose highest derivative is determined has many times the power of the noise at its fastest parts,
and falls below the noise within an octave. Where nothing does so in any octave of any stretch, a search
through finer resolutions finds nothing, and would take most of the time of a fit.
"""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray

CORRELATIONS = (0.0, 0.3, 0.6, 0.8, 0.9, 0.95, 0.98, 1.0)
"""Correlations of neighboring samples of the noise that are tried. The filter that removes one keeps the
ratio of motion to noise at each frequency, and is too flat to remove a motion: a factor of 4 in an octave."""

FEWEST = 2048
"""Fewest samples for which a search takes long enough to be ended early."""

FEWEST_MEANS = 32
"""Fewest means of an octave: with these, differences pass from 8 periods in the recording on."""

DIFFERENCES = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / np.sqrt(70)
"""Weights of differences of fourth order, which keep the deviation of white noise. They pass the octave below
the highest frequency of means."""

WINDOW = 64
"""Number of differences in a stretch, some 25 of them independent: one of noise rarely has twice the mean
power. A motion from rest to rest, with 6 coefficients determined to a quarter, has thrice."""

EQUAL = 1.4
"""Largest ratio of the power of white noise in an octave to that in finer ones, by medians over stretches; of
a few stretches it may be as large as 1 + 1/sqrt(stretches)."""

LARGEST = 2.5
"""Largest ratio of the power of white noise in a stretch to the median of all finer octaves."""

EVEN = 4.0
"""Largest interval between samples, in usual ones, at which octaves of samples are octaves of time."""

SPANS_PER_MEAN = 16
"""Spans with which a search ends, for each mean of the coarsest octave that is noise alone. A quarter
resolves the motion, and the next resolution has to confirm it; but where the noise was not understood before,
a motion is accepted up to four times later."""


def enough_spans(time: FloatArray, row: FloatArray) -> float:
    """Return the number of spans after which finer ones show nothing new; infinite if that is uncertain.

    Args:
        time: times, (samples,), s.
        row: values, (samples,).
    """
    steps = np.diff(time)
    if len(row) < FEWEST or steps.max() > EVEN * float(np.median(steps)):
        return np.inf
    whitened = (row[1:] - correlation * row[:-1] for correlation in CORRELATIONS)
    return SPANS_PER_MEAN * min(map(_means_of_motion, whitened))


def _means_of_motion(values: FloatArray) -> float:
    """Return the number of means in the finest octave with more than white noise.

    In the first octave, beyond the fastest motion that splines resolve, only stretches of noise may differ,
    as where an encoder flickers. It is infinite if nothing is certain.
    """
    means, count = values, np.inf
    floors: list[float] = []
    while len(means) >= FEWEST_MEANS:
        powers = _powers(means)
        middle = float(np.median(powers))
        floor = float(np.median(floors)) if floors else middle
        allowed = max(EQUAL, 1 + 1 / np.sqrt(len(powers)))
        equal = floor / allowed <= middle <= allowed * floor
        if not (floor and equal and (not floors or powers.max() <= LARGEST * floor)):
            return count
        floors.append(middle)
        count = len(means) / 2
        means = means[: len(means) // 2 * 2].reshape(-1, 2).sum(axis=1) / np.sqrt(2)
    return count


def _powers(means: FloatArray) -> FloatArray:
    """Return the mean square of the differences of means in each stretch, (stretches,)."""
    squares = np.convolve(means, DIFFERENCES, "valid") ** 2
    stretches = np.array_split(squares, max(1, len(squares) // WINDOW))
    return np.array([stretch.mean() for stretch in stretches])
