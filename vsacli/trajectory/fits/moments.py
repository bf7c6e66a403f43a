"""Sums over the samples in equal bins of time, from which means over bins of any power of two follow."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray

BLOCK_SAMPLES = 65536
"""That are held at a time: what fits into a cache is twice as fast."""


class Moments(NamedTuple):
    """What equal bins of a record are averaged from: one pass over the samples serves all resolutions.

    Attributes:
        start: of the record, s.
        width: of a bin, s.
        powers: sums over the samples of a bin of the powers 0, 1, ... of their place in it, 0 to 1,
            (powers, bins).
        time: sums of their times, (bins,).
        row: sums of their values, (bins,).
    """

    start: float
    width: float
    powers: FloatArray
    time: FloatArray
    row: FloatArray

    @classmethod
    def of(cls, time: FloatArray, row: FloatArray, bins: int, degree: int) -> Moments:
        """Sums over samples.

        Args:
            time: (samples,), s.
            row: (samples,).
            bins: of equal width.
            degree: of the highest power.
        """
        start, width = float(time[0]), float(time[-1] - time[0]) / bins
        sums = np.zeros((degree + 3, bins))
        for first in range(0, len(time), BLOCK_SAMPLES):
            block = slice(first, first + BLOCK_SAMPLES)
            place = np.clip((time[block] - start) / width, 0, bins * (1 - 1e-15))
            which = np.minimum(place.astype(int), bins - 1)
            place -= which
            power = np.ones_like(place)
            for total in sums[:-2]:
                total += np.bincount(which, power, minlength=bins)
                power *= place
            sums[-2] += np.bincount(which, time[block], minlength=bins)
            sums[-1] += np.bincount(which, row[block], minlength=bins)
        return cls(start, width, sums[:-2], sums[-2], sums[-1])

    @property
    def halved(self) -> Moments:
        """Those of half as many bins, twice as wide; their number must be even."""
        powers = merged(self.powers[:, ::2], self.powers[:, 1::2])
        time, row = self.time[::2] + self.time[1::2], self.row[::2] + self.row[1::2]
        return Moments(self.start, 2 * self.width, powers, time, row)


def merged(left: FloatArray, right: FloatArray) -> FloatArray:
    """Sums of the powers of places in a bin twice as wide, from those in its halves, (powers, bins)."""
    count = len(left)
    shift = np.array([[math.comb(k, i) for i in range(count)] for k in range(count)], dtype=np.float64)
    return np.asarray((left + shift @ right) / 2.0 ** np.arange(count)[:, None])
