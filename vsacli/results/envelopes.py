"""Long runs reduced to what can be seen: the envelope of a curve, and stretches of marked steps.

Whatever is drawn, a figure or a page, is reduced here, so that a peak of one sample is seen everywhere.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray

COLUMNS = 1200
"""Intervals of time a long run is divided into: one pixel column each of a 4 inch panel at 300 dpi."""

FULL_DETAIL = 2 * COLUMNS
"""Runs of up to this many samples are drawn as they are."""


WIDE_COLUMNS = 200
"""Intervals of which an envelope is drawn: each is about as wide as a line in a panel of 3 inches."""

RESTLESS = 3.0
"""Range of the samples of such an interval, over the step of their mean to the next, from which on an
envelope is drawn. A curve that rises or falls has 1, and so has a wave of which 100 fill a panel, whose line
still reads; one of which 300 do, a blot, 5; noise 4 with four samples in an interval, and more with more."""

SEEN_SHARE = 0.01
"""Share of the height of a panel that the width of a line takes."""


class Envelope(NamedTuple):
    """What the samples of each column span.

    Attributes:
        time: of the middle of each column, (columns,), s.
        mean, low, high: of its samples, (..., columns); NaN if one of them is.
    """

    time: FloatArray
    mean: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, time: FloatArray, values: FloatArray, starts: IndexArray) -> Envelope:
        """Of values, (..., samples), in columns that begin at these samples."""
        return cls(time, values, values, values).joined(starts)

    def joined(self, starts: IndexArray) -> Envelope:
        """Of fewer columns, which begin at these."""
        ends = np.append(starts[1:], self.time.size) - 1
        with np.errstate(invalid="ignore"):  # means of infinities
            mean = np.add.reduceat(self.mean, starts, axis=-1) / (ends - starts + 1)
        low = np.minimum.reduceat(self.low, starts, axis=-1)
        high = np.maximum.reduceat(self.high, starts, axis=-1)
        return Envelope((self.time[starts] + self.time[ends]) / 2, mean, low, high)

    @property
    def restless(self) -> bool:
        """Whether a line through all samples of the one curve would be a blot, as of noise.

        Its samples go up and down within a column much more than from column to column, and visibly.
        """
        whole = np.isfinite(self.mean)
        if np.count_nonzero(whole) < 2:
            return False
        ranges, steps = (self.high - self.low)[whole], np.abs(np.diff(self.mean[whole]))
        visible = SEEN_SHARE * (self.high[whole].max() - self.low[whole].min())
        return bool(np.median(ranges) > max(visible, RESTLESS * np.median(steps)))


def column_starts(time: FloatArray, columns: int = COLUMNS) -> IndexArray:
    """First sample of each of so many equal intervals of time that hold any; ascending from 0."""
    edges = np.linspace(time[0], time[-1], columns + 1)[:-1]
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
