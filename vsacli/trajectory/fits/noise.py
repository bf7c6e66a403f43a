"""Noise of samples: by divided differences before a fit, by lines in the spectrum of its residual."""

from __future__ import annotations

from typing import NamedTuple

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
"""Share of the largest value below which differences are rounding."""


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
    """Return whether there is noise that a filter hides from neighbouring samples, (components,).

    Differences of every second, fourth, ... sample grow by 2^order each time as long as motion is smooth over
    this many samples, those of filtered noise by less and less.

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
    """Return the standard deviation of normal differences with the same median, in motion, (components,)."""
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
    """Return differences of samples `stride` apart, the first of each given, (components, differences)."""
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


LINE_RATIO = 100.0
"""Ratio of the power at a frequency to the median near it, from which on it is a line.

White noise never reaches it. Of 40 recordings without lines none exceeded 10, with lines the least was 150;
the remainder that a filter left of the rounding of an encoder, under a motion that is symmetric in time,
reached 45.
"""

LEAST_EFFECT = 0.1
"""Share of the highest derivative that a line must have to count."""

MOST_LINES = 20
"""More are the rounding error of an encoder under a periodic motion, whose period they have: some hundred of
a motion that was repeated ten times."""

NEIGHBOURS = 40
"""Frequencies on each side that the median is taken of."""

FEW_NEIGHBOURS = 10
"""The same of frequencies that have fewer below them: a slow sine that a coarse spline leaves out."""

BLOCK_FREQUENCIES = 16384
"""Frequencies whose medians are taken at a time, to bound the memory."""

LEAKAGE = 3
"""Frequencies beside a line that a Hann window leaks into."""

MAINS = (50.0, 60.0)
"""Hz."""

MAINS_RTOL = 0.005
"""Networks keep their frequency to 0.2 Hz; clocks of data loggers to less."""

UNEVEN = 0.2
"""Share of a step by which stamps may be uneven for a periodogram."""


CLOSE_LINES = 2.0
"""Lines of a spectrum within which frequencies are the same."""

FAR = 10.0
"""Least ratio of the middle of two images to their distance from it. Harmonics of a motion are closer."""

STEP_TOLERANCE = 0.01
"""Share of an encoder's step by which values may miss its multiples, as they were printed."""

ROUNDING_RATIO = 1.5
"""Ratio of the power of a residual to that of rounding to an encoder's steps, up to which it is all
rounding."""


class Lines(NamedTuple):
    """Frequencies that stand out of the residual of a fit.

    Attributes:
        hum: those of mains, Hz.
        others: which may be motion, Hz.
        share: of the residual's power that the others carry.
        resampled: rate from which resampling left images of the motion, Hz; 0 if there are none.
    """

    hum: tuple[float, ...] = ()
    others: tuple[float, ...] = ()
    share: float = 0.0
    resampled: float = 0.0

    def stretched(self, factor: float) -> Lines:
        """Return the lines of the same motion, slower by a factor."""
        hum = tuple(frequency / factor for frequency in self.hum)
        others = tuple(frequency / factor for frequency in self.others)
        return Lines(hum, others, self.share, self.resampled / factor)


def spectral_lines(
    time: FloatArray, residual: FloatArray, order: int, size: float, bandwidth: float | None = None
) -> Lines:
    """Frequencies that stand out of the residual of a fit, from its periodogram with a Hann window.

    Args:
        time: (samples,), s; nothing is said of records with uneven stamps.
        residual: (samples,).
        order: of the highest derivative that is needed.
        size: of that derivative of the fit, root mean square; lines that would add less than 10 % to it do
            not count, as what a coarse spline leaves of a motion has lines too.
        bandwidth: above which there is no motion, Hz, if it is known: lines above it are noise.
    """
    steps = np.diff(time)
    step = float(np.mean(steps))
    if len(time) < 4 * NEIGHBOURS or np.abs(steps - step).max() > UNEVEN * step:
        return Lines()
    power = np.abs(np.fft.rfft(residual * np.hanning(len(residual)))) ** 2
    narrow, wide = _standing_out(power, FEW_NEIGHBOURS), _standing_out(power, NEIGHBOURS)
    slow = NEIGHBOURS + LEAKAGE  # below it there are fewer neighbours
    found = np.concatenate([narrow[narrow < slow], wide])
    frequencies = found / (len(time) * step)
    # a Hann window leaves a quarter of a line's amplitude times the number of samples
    derivatives = 4 * np.sqrt(power[found] / 2) / len(time) * (2 * np.pi * frequencies) ** order
    matter = derivatives > LEAST_EFFECT * size
    found, frequencies = found[matter], frequencies[matter]
    if len(found) > MOST_LINES:
        return Lines()
    near = CLOSE_LINES / (len(time) * step)
    mains = _mains(frequencies)
    mains |= _side_bands(frequencies, mains, near)
    images, resampled = _images(frequencies, near)
    unclear = ~mains & ~images & (frequencies < (np.inf if bandwidth is None else bandwidth))
    places = np.unique(found[unclear, None] + np.arange(-LEAKAGE, LEAKAGE + 1))
    share = float(np.sum(power[places]) / max(np.sum(power), np.finfo(float).tiny))
    hum, others = (tuple(frequencies[which].tolist()) for which in (mains & ~images, unclear))
    return Lines(hum, others, share, resampled)


def _standing_out(power: FloatArray, neighbours: int) -> IndexArray:
    """Return indices of lines among the frequencies with that number of neighbors on both sides."""
    windows = np.lib.stride_tricks.sliding_window_view(power, neighbours)
    starts = range(0, len(windows), BLOCK_FREQUENCIES)
    medians = np.concatenate([np.median(windows[at : at + BLOCK_FREQUENCIES], axis=1) for at in starts])
    centre = np.arange(neighbours + LEAKAGE, len(power) - neighbours - LEAKAGE)
    below = medians[centre - neighbours - LEAKAGE]
    # of a spectrum that falls steeply, the side below has the larger median
    beside = np.maximum(below, medians[centre + LEAKAGE + 1])
    here = power[centre]
    peak = (here >= power[centre - 1]) & (here >= power[centre + 1])
    return np.asarray(centre[peak & (here > LINE_RATIO * beside)])


def _side_bands(frequencies: FloatArray, mains: BoolArray, near: float) -> BoolArray:
    """Return which lie in pairs about a line of mains: side bands of hum that grows and fades."""
    found = np.zeros(len(frequencies), dtype=bool)
    for middle in frequencies[mains]:
        mirrored = 2 * middle - frequencies
        found |= np.any(np.abs(frequencies[:, None] - mirrored) < near, axis=1)
    return found


def _images(frequencies: FloatArray, near: float) -> tuple[BoolArray, float]:
    """Return which are images that resampling left, pairs about a rate and about its double; and the rate.

    What interpolates samples of another rate repeats the motion's lines on both sides of its multiples.
    """
    first, second = np.triu_indices(len(frequencies), 1)
    far = (frequencies[first] + frequencies[second]) > FAR * (frequencies[second] - frequencies[first])
    first, second = first[far], second[far]
    middle = (frequencies[first] + frequencies[second]) / 2
    distance = (frequencies[second] - frequencies[first]) / 2
    found, rates = np.zeros(len(frequencies), dtype=bool), []
    for rate, about in zip(middle, distance, strict=True):
        multiple = np.round(middle / rate)
        alike = (np.abs(middle - multiple * rate) < near) & (np.abs(distance - about) < near)
        if np.any(alike & (multiple == 2)):
            rates.append(float(rate))
            found[first[alike]] = found[second[alike]] = True
    return found, min(rates, default=0.0)


def is_rounding(row: FloatArray, residual: FloatArray) -> bool:
    """Return whether steps of an encoder explain a residual: at constant velocity they are lines.

    Args:
        row: recorded samples, (samples,).
        residual: (samples,), of its fit.
    """
    values = np.unique(row)
    step = float(np.diff(values).min())
    counts = (values - values[0]) / step
    multiples = bool(np.all(np.abs(counts - np.round(counts)) < STEP_TOLERANCE))
    return multiples and bool(np.mean(residual**2) <= ROUNDING_RATIO * step**2 / 12)


def _mains(frequencies: FloatArray) -> BoolArray:
    """Return the multiples of a mains frequency."""
    near = np.zeros(len(frequencies), dtype=bool)
    for mains in MAINS:
        harmonic = mains * np.round(frequencies / mains)
        near |= (harmonic > 0) & (np.abs(frequencies - harmonic) < MAINS_RTOL * frequencies)
    return near
