"""Long runs reduced to what can be seen: the envelope of a curve, and stretches of marked steps.

Whatever is drawn, a figure or a page, is reduced here, so that a peak of one sample is seen everywhere.
"""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray

COLUMNS = 1200
"""Intervals of time a long run is divided into: one pixel column each of a 4 inch panel at 300 dpi."""

FULL_DETAIL = 2 * COLUMNS
"""Runs of up to this many samples are drawn as they are."""


def column_starts(time: FloatArray) -> IndexArray:
    """First sample of each of the `COLUMNS` equal intervals of time that hold any; ascending from 0."""
    edges = np.linspace(time[0], time[-1], COLUMNS + 1)[:-1]
    return np.unique(np.searchsorted(time, edges))


def kept_samples(values: FloatArray, starts: IndexArray) -> IndexArray:
    """Ascending indices of the samples that draw the same line as all of them.

    From each column the first and the last sample and the extremes; between any two of these a NaN where
    there is one, so that no gap is bridged.

    Args:
        values: one curve, (samples,).
        starts: first sample of each column, ascending from 0.
    """
    lengths = np.diff(starts, append=values.size)
    extremes = [
        _first_hits(values == np.repeat(extreme.reduceat(values, starts), lengths), starts)
        for extreme in (np.fmin, np.fmax)
    ]
    kept = np.unique(np.concatenate([starts, starts + lengths - 1, *extremes]))
    gaps = np.append(np.flatnonzero(np.isnan(values)), values.size)
    next_gap = gaps[np.searchsorted(gaps, kept)]
    return np.union1d(kept, next_gap[next_gap < values.size])


def _first_hits(hits: BoolArray, starts: IndexArray) -> IndexArray:
    """The first True of each column that has one."""
    indices = np.flatnonzero(hits)
    column = np.searchsorted(starts, indices, side="right")
    return indices[np.diff(column, prepend=0) > 0]


def marked_spans(time: FloatArray, marked: BoolArray) -> FloatArray:
    """Stretches of time made of marked steps, each step reaching half-way to its neighbours.

    Stretches less than a column apart are drawn as one.

    Args:
        time: (samples,), s, ascending.
        marked: (samples,).

    Returns:
        Start and end of each stretch, (stretches, 2), s.
    """
    borders = np.concatenate([time[:1], (time[1:] + time[:-1]) / 2, time[-1:]])
    changes = np.flatnonzero(np.diff(marked, prepend=False, append=False))
    start, end = borders[changes].reshape(-1, 2).T
    joined = np.flatnonzero(start[1:] - end[:-1] <= (time[-1] - time[0]) / COLUMNS)
    return np.column_stack([np.delete(start, joined + 1), np.delete(end, joined)])
