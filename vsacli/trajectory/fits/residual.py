"""What residuals of fits say about noise: whether a fit follows it, and the frequencies that stand out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.trajectory.fits.least_squares import fit_spline

LINE_RATIO = 30.0
"""Of the power at a frequency to the median near it, from which on it is a line. White noise reaches 30 once
in 10^9 frequencies; of 40 records without lines none exceeded 10, with lines the least was 150."""

LEAST_EFFECT = 0.1
"""Share of the highest derivative that a line must have to count."""

MOST_LINES = 20
"""More are the rounding error of an encoder under a periodic motion, whose period they have: some hundred of
a motion that was repeated ten times."""

NEIGHBOURS = 40
"""Frequencies on each side that the median is taken of."""

LEAKAGE = 3
"""Frequencies beside a line that a Hann window leaks into."""

MAINS = (50.0, 60.0)
"""Hz."""

MAINS_RTOL = 0.005
"""Networks keep their frequency to 0.2 Hz; clocks of data loggers to less."""

UNEVEN = 0.2
"""Share of a step by which stamps may be uneven for a periodogram."""

SPANS_RATIO = 2**0.5
"""Of successive numbers of spans of `slowest_fall`."""

STAGNATION = 2.4
"""Least factor by which `SPANS_RATIO` times as many spans reduce the residual of a motion: 2^(5/4) if its
acceleration jumps, 4.5 and more from rest to rest, 16 if it is smooth. White noise gives 1, noise that was
filtered 1.1 to 1.7 until the knots are beyond the filter's band."""

FLAT = 1.3
"""Such a factor below which the record is noisy for sure: a clean motion with steps of velocity, smoothed
over 50 ms, has 1.4."""

RESOLVED = 30.0
"""Factor by which a residual must be below the record's own size to count as one of noise."""

WHITE = 1.5
"""Factor between that residual and the noise that a fit leaves, beyond which the fit follows noise. It is 1
if noise is white."""

ROUNDING = 1000 * np.finfo(float).eps
"""Of the largest value; residuals below are what arithmetic leaves."""

WINDOW, MOST_WINDOWS = 16384, 3
"""Samples that are looked at together, and how many such parts of a long record: noise is everywhere."""

COARSEST_SPANS = 16
"""Of `slowest_fall`."""


class Lines(NamedTuple):
    """Frequencies that stand out of the residual of a fit.

    Attributes:
        hum: those of mains, Hz.
        others: which may be motion, Hz.
        share: of the residual's power that the others carry.
    """

    hum: tuple[float, ...] = ()
    others: tuple[float, ...] = ()
    share: float = 0.0

    def stretched(self, factor: float) -> Lines:
        """Those of the same course, slower by a factor."""
        hum = tuple(frequency / factor for frequency in self.hum)
        return Lines(hum, tuple(frequency / factor for frequency in self.others), self.share)


def spectral_lines(time: FloatArray, residual: FloatArray, order: int, size: float) -> Lines:
    """Frequencies that stand out of the residual of a fit, from its periodogram with a Hann window.

    Args:
        time: (samples,), s; nothing is said of records with uneven stamps.
        residual: (samples,).
        order: of the highest derivative that is needed.
        size: of that derivative of the fit, root mean square; lines that would add less than 10 % to it do
            not count, as what a coarse spline leaves of a motion has lines too.
    """
    steps = np.diff(time)
    step = float(np.mean(steps))
    if len(time) < 4 * NEIGHBOURS or np.abs(steps - step).max() > UNEVEN * step:
        return Lines()
    power = np.abs(np.fft.rfft(residual * np.hanning(len(residual)))) ** 2
    count = len(power)
    medians = np.median(np.lib.stride_tricks.sliding_window_view(power, NEIGHBOURS), axis=1)
    centre = np.arange(NEIGHBOURS + LEAKAGE, count - NEIGHBOURS - LEAKAGE)
    below = medians[centre - NEIGHBOURS - LEAKAGE]
    # of a spectrum that falls steeply, the side below has the larger median
    beside = np.maximum(below, medians[centre + LEAKAGE + 1])
    here = power[centre]
    peak = (here >= power[centre - 1]) & (here >= power[centre + 1])
    found = centre[peak & (here > LINE_RATIO * beside)]
    frequencies = found / (len(time) * step)
    # a Hann window leaves a quarter of a line's amplitude times the number of samples
    derivatives = 4 * np.sqrt(power[found] / 2) / len(time) * (2 * np.pi * frequencies) ** order
    matter = derivatives > LEAST_EFFECT * size
    found, frequencies = found[matter], frequencies[matter]
    if len(found) > MOST_LINES:
        return Lines()
    mains = _mains(frequencies)
    near = np.unique(found[~mains, None] + np.arange(-LEAKAGE, LEAKAGE + 1))
    share = float(np.sum(power[near]) / max(np.sum(power), np.finfo(float).tiny))
    return Lines(tuple(frequencies[mains].tolist()), tuple(frequencies[~mains].tolist()), share)


def _mains(frequencies: FloatArray) -> BoolArray:
    """Which are multiples of a frequency of mains."""
    near = np.zeros(len(frequencies), dtype=bool)
    for mains in MAINS:
        harmonic = mains * np.round(frequencies / mains)
        near |= (harmonic > 0) & (np.abs(frequencies - harmonic) < MAINS_RTOL * frequencies)
    return near


def slowest_fall(time: FloatArray, row: FloatArray, degree: int, noise: float) -> float:
    """The least factor by which residuals of coarse splines fall with more knots, while above a fit's noise.

    With more knots the residual of a motion that is resolved falls by a power of their number, that of noise
    hardly. White noise stays so until there are as many knots as samples. Filtered noise is followed by a
    spline whose knots are as close as the filter's band asks for, which then takes little for noise.

    Args:
        time: (samples,), s.
        row: (samples,).
        degree: of the splines.
        noise: standard deviation that the fit in question takes for noise.

    Returns:
        With `SPANS_RATIO` times as many spans; `STAGNATION` or more of records without noise, or with white.
    """
    starts = np.linspace(0, max(0, len(time) - WINDOW), min(MOST_WINDOWS, -(-len(time) // WINDOW)))
    windows = [slice(start, start + WINDOW) for start in starts.astype(int).tolist()]
    return min(_slowest_fall(time[window], row[window], degree, noise) for window in windows)


def _slowest_fall(time: FloatArray, row: FloatArray, degree: int, noise: float) -> float:
    """Of one window."""
    size, last, spans = float(np.std(row)), np.inf, float(COARSEST_SPANS)
    least, slowest = max(WHITE * noise, ROUNDING * float(np.abs(row).max())), np.inf
    while 4 * spans <= len(time):
        residual = row - fit_spline(time, row[None], round(spans), degree)(time)[:, 0]
        rms = float(np.sqrt(np.mean(residual**2)))
        if rms < least:
            break
        if rms < size / RESOLVED:
            slowest = min(slowest, last / rms)
        last, spans = rms, SPANS_RATIO * spans
    return slowest
