"""Motion that a fit leaves out, by the spectrum of its residual.

A residual must look like noise. Beyond the cut-off of a fit that leaves motion out, its spectrum falls
steeply until noise covers it. That of noise is flat, also of filtered noise up to the filter's cut-off.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray

FIRST_LINE = 3
"""Lowest line of the octaves, in cycles per recording."""

FALL = 6.0
"""Smallest fall of the density in an octave that is motion. Of steps of velocity it falls by 16, that of
noise of first order by 4."""

BROADEST = 2
"""Most octaves with nearly the largest density if the residual is motion: those at the cut-off of the fit."""

FEWEST_SAMPLES = 64
"""Fewest samples of a spectrum."""


class LeftOutMotion(NamedTuple):
    """Motion that a fit does not follow.

    Attributes:
        frequency: middle of each band, Hz, (bands,).
        power: mean square of the motion in each band, (bands,).
        above: frequency above which there is only noise, Hz.
    """

    frequency: FloatArray
    power: FloatArray
    above: float

    @property
    def size(self) -> float:
        """Root mean square of the motion."""
        return float(np.sqrt(np.sum(self.power)))

    def covariance(self, orders: int) -> FloatArray:
        """Return the covariance of value and derivatives, (orders, orders)."""
        phasor = (2j * np.pi * self.frequency[:, None]) ** np.arange(orders)
        return np.asarray(np.real(phasor.T @ (self.power[:, None] * phasor.conj())))

    def stretched(self, factor: float) -> LeftOutMotion:
        """Return the motion slowed down by a factor."""
        return LeftOutMotion(self.frequency / factor, self.power, self.above / factor)


def left_out_motion(time: FloatArray, residual: FloatArray) -> LeftOutMotion | None:
    """Return the motion in a residual, (samples,), at times, s; None if it looks like noise."""
    count = len(time)
    if count < FEWEST_SAMPLES:
        return None
    even = np.interp(np.linspace(time[0], time[-1], count), time, residual)
    window = np.hanning(count)
    power = 2 * np.abs(np.fft.rfft(window * even)) ** 2 / (count * np.sum(window**2))
    edges = FIRST_LINE * 2 ** np.arange(int(np.log2(len(power) / FIRST_LINE)) + 1)
    density = np.array([np.mean(power[start:stop]) for start, stop in pairwise(edges.tolist())])
    high = np.flatnonzero(density >= density.max() / FALL)
    falls = density[high[-1] : -1] > FALL * density[high[-1] + 1 :]
    last = int(high[-1] + (len(falls) if falls.all() else np.argmin(falls)))
    first = int(high[0])
    if np.ptp(high) >= BROADEST or last == high[-1]:
        return None
    step = 1 / float(time[-1] - time[0])
    middle = step * np.sqrt(2) * edges[first:last]
    missed = edges[first:last] * (density[first:last] - density[last])
    return LeftOutMotion(middle, missed, float(step * edges[last]))
