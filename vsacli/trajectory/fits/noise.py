"""Noise of samples: by divided differences before a fit, and by lines in the spectrum of its residual."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray

BLOCK_SAMPLES = 16384
"""Samples whose differences are held in memory at a time."""

PROBES = 4096
"""Largest number of differences at each stride whose median is computed."""

ABOVE_FLOOR = 10.0
"""Factor over the differences of neighboring samples above which noise is not white. Below it interpolation
knows the noise well enough. For computed samples the factor was up to 3 before motion became visible; for
noise with a low-pass filter at 50 Hz or less it was 10^3 and more."""

BELOW_MOTION = 30.0
"""Factor below the largest differences of any stride, above which differences count as motion: differences at
strides as long as its fastest parts also grow slowly."""

SLOW_GROWTH = 8.0
"""Growth of differences from one stride to twice that below which they are noise. For 6 motions x 12 seeds at
4 rates it was 9 and more, mostly 2^8; for filtered noise it was below 5 at some stride."""

ROUNDING = 10 * np.finfo(float).eps
"""Share of the largest value below which differences count as rounding."""


EQUAL_STRIDES = 1.3
"""Largest ratio of the differences of neighboring samples to those of every second one for white noise. Their
medians differ by some 10 % in 500 samples, and of rounded samples they are multiples of a step, such as 11
and 14; for noise with a correlation of 0.5 from sample to sample the ratio is 1.34."""

FEWEST_DIFFERENCES = 16
"""Fewest samples, in orders of the differences, with which their medians are certain to some 10 %."""

AT_REST = 1e-6
"""Share of a recording's standard deviation within which samples are at rest. An encoder at rest has no
noise, and may rest most of the time."""


def estimated_noise(time: FloatArray, rows: FloatArray, order: int) -> FloatArray:
    """Return the standard deviation of independent noise.

    Args:
        time: times, (samples,), s.
        rows: values, (components, samples).
        order: order of the differences.

    Returns:
        Standard deviations, (components,); zero if there are too few samples.
    """
    count = len(time) - order
    power = np.zeros(len(rows))
    for start in range(0, count, BLOCK_SAMPLES):
        first = np.arange(start, min(count, start + BLOCK_SAMPLES))
        power += np.sum(_differences(time, rows, order, first, 1) ** 2, axis=1)
    return np.asarray(np.sqrt(power / max(1, count)))


def filtered_noise(time: FloatArray, rows: FloatArray, order: int) -> BoolArray:
    """Return whether there is noise that a filter hides from neighboring samples, (components,).

    Differences of every second, fourth, ... sample grow by 2^order each time as long as motion is smooth over
    this many samples, those of filtered noise by less and less.

    Args:
        time: times, (samples,), s.
        rows: values, (components, samples).
        order: order of the differences.
    """
    if len(time) <= order:
        return np.zeros(len(rows), dtype=bool)
    deviations = np.array(
        [_median_deviation(time, rows, order, stride) for stride in _strides(len(time), order)]
    )
    min_deviation = ABOVE_FLOOR * np.maximum(deviations[0], ROUNDING * np.abs(rows).max(axis=1))
    is_between = (deviations > min_deviation) & (deviations < deviations.max(axis=0) / BELOW_MOTION)
    return np.asarray(np.any(is_between[:-1] & (deviations[1:] < SLOW_GROWTH * deviations[:-1]), axis=0))


def typical_noise(time: FloatArray, rows: FloatArray, order: int) -> FloatArray:
    """Return the standard deviation of independent noise, (components,), robust to jumps of motion.

    Args:
        time: times, (samples,), s.
        rows: values, (components, samples).
        order: order of the differences.
    """
    return _median_deviation(time, rows, order, 1) if len(time) > order else np.zeros(len(rows))


def white_noise_level(time: FloatArray, row: FloatArray, order: int) -> float | None:
    """Return the standard deviation of white noise that hides the motion in the differences of a row.

    It is known if differences of every second sample are as large: those of a motion are 2^order times, and
    those of noise that a filter made smooth are larger, too. Those of a fast motion may exceed the noise from
    there on; then they grow on like a motion.

    Args:
        time: times, (samples,), s.
        row: values, (samples,).
        order: order of the differences.

    Returns:
        The standard deviation; None if there is other noise, less noise than motion, or none.
    """
    if len(time) < FEWEST_DIFFERENCES * order:
        return None
    nearest, second, fourth = (
        float(_median_deviation(time, row[None], order, stride)[0]) for stride in (1, 2, 4)
    )
    if not ROUNDING * np.abs(row).max() < nearest <= EQUAL_STRIDES * second:
        return None
    is_moving = second < SLOW_GROWTH * nearest and SLOW_GROWTH * second < fourth
    is_fast_motion = is_moving and not filtered_noise(time, row[None], order)[0]
    return nearest if is_fast_motion or second <= EQUAL_STRIDES * nearest else None


def _strides(samples: int, order: int) -> list[int]:
    """Return powers of two, as long as three such differences fit into the recording one after the other."""
    return [2**power for power in range(max(1, (samples // (3 * order)).bit_length()))]


def _median_deviation(time: FloatArray, rows: FloatArray, order: int, stride: int) -> FloatArray:
    """Return the standard deviation of differences in motion by their median, (components,)."""
    last_start = len(time) - 1 - order * stride
    first = np.unique(np.linspace(0, last_start, min(PROBES, last_start + 1)).astype(int))
    magnitudes = np.abs(_differences(time, rows, order, first, stride))
    nodes = rows[:, first + stride * np.arange(order + 1)[:, None]]
    is_moving = np.ptp(nodes, axis=1) > AT_REST * np.std(rows, axis=1, keepdims=True)
    medians = [
        np.median(size[of]) if of.any() else 0.0 for size, of in zip(magnitudes, is_moving, strict=True)
    ]
    return np.array(medians) / 0.6745


def _differences(
    time: FloatArray, rows: FloatArray, order: int, first: IndexArray, stride: int
) -> FloatArray:
    """Return normalized divided differences of samples `stride` apart, (components, differences)."""
    nodes = [time[first + i * stride] for i in range(order + 1)]
    span = nodes[-1] - nodes[0]
    weights = np.ones((order + 1, len(first)))
    for i, node in enumerate(nodes):
        for other in (*nodes[:i], *nodes[i + 1 :]):
            weights[i] /= (node - other) / span
    weights /= np.sqrt(np.sum(weights**2, axis=0))
    difference_sums = np.zeros((len(rows), len(first)))
    for i, weight in enumerate(weights):
        difference_sums += weight * rows[:, first + i * stride]
    return difference_sums


LINE_RATIO = 100.0
"""Ratio of the power at a frequency to the median near it above which it is a line.

White noise never reaches it. Of 40 recordings without lines none exceeded 10; the smallest with lines was
150. Filtered rounding of an encoder, under a motion that is symmetric in time, reached 45.
"""

LEAST_EFFECT = 0.1
"""Smallest share of the highest derivative for a line to count."""

MOST_LINES = 20
"""Most lines; more are the rounding of an encoder under a periodic motion, which has its period: some hundred
lines for a motion that is repeated ten times."""

NEIGHBORS = 40
"""Number of frequencies on each side whose median is computed."""

FEW_NEIGHBORS = 10
"""The same number for low frequencies, with fewer below them: slow sines left by a coarse spline."""

BLOCK_FREQUENCIES = 16384
"""Frequencies whose medians are computed at a time, to bound the memory."""

LEAKAGE = 3
"""Number of frequencies on each side of a line into which a Hann window leaks."""

MAINS = (50.0, 60.0)
"""Mains frequencies, Hz."""

MAINS_RTOL = 0.005
"""Relative tolerance of a mains frequency: 0.2 Hz for the grid, and the clock of the data logger."""

UNEVEN = 0.2
"""Share of a sampling interval by which stamps may be uneven for a periodogram."""


CLOSE_LINES = 2.0
"""Distance, in frequencies of the spectrum, within which two lines are the same."""

FAR = 10.0
"""Smallest ratio of the middle of two images to their distance. Harmonics of a motion have a smaller one."""

STEP_TOLERANCE = 0.01
"""Share of an encoder's step by which values may differ from its multiples, due to printed digits."""

ROUNDING_RATIO = 1.5
"""Largest power of a residual that is only rounding to an encoder's steps, over the power of rounding."""


class Lines(NamedTuple):
    """Frequencies that stand out of the residual of a fit.

    Attributes:
        hum: lines of mains hum, Hz.
        others: other lines, which may be motion, Hz.
        share: share of the residual's power in the others.
        resampled: original sample rate, Hz, if resampling left images of the motion; 0 otherwise.
    """

    hum: tuple[float, ...] = ()
    others: tuple[float, ...] = ()
    share: float = 0.0
    resampled: float = 0.0

    def stretched(self, factor: float) -> Lines:
        """Return the lines of the motion slowed down by a factor."""
        hum = tuple(frequency / factor for frequency in self.hum)
        others = tuple(frequency / factor for frequency in self.others)
        return Lines(hum, others, self.share, self.resampled / factor)


def spectral_lines(
    time: FloatArray, residual: FloatArray, order: int, size: float, bandwidth: float | None = None
) -> Lines:
    """Return the frequencies that stand out of a fit's residual, by its periodogram with a Hann window.

    Args:
        time: times, (samples,), s; no lines are returned for uneven stamps.
        residual: sample minus fit, (samples,).
        order: order of the highest derivative that is needed.
        size: root mean square of this derivative of the fit. Lines that would add less than 10 % to it are
            ignored, since the part of a motion that a coarse spline does not follow has lines, too.
        bandwidth: frequency above which there is no motion, Hz; lines above it are noise. None if unknown.
    """
    steps = np.diff(time)
    step = float(np.mean(steps))
    if len(time) < 4 * NEIGHBORS or np.abs(steps - step).max() > UNEVEN * step:
        return Lines()
    power = np.abs(np.fft.rfft(residual * np.hanning(len(residual)))) ** 2
    narrow, wide = _line_indices(power, FEW_NEIGHBORS), _line_indices(power, NEIGHBORS)
    min_wide_index = NEIGHBORS + LEAKAGE  # lower frequencies have fewer neighbors
    line_indices = np.concatenate([narrow[narrow < min_wide_index], wide])
    frequencies = line_indices / (len(time) * step)
    # With a Hann window the magnitude at a line is a quarter of amplitude times number of samples.
    derivatives = 4 * np.sqrt(power[line_indices] / 2) / len(time) * (2 * np.pi * frequencies) ** order
    is_effective = derivatives > LEAST_EFFECT * size
    line_indices, frequencies = line_indices[is_effective], frequencies[is_effective]
    if len(line_indices) > MOST_LINES:
        return Lines()
    frequency_tolerance = CLOSE_LINES / (len(time) * step)
    is_mains = _mains_mask(frequencies)
    is_mains |= _side_band_mask(frequencies, is_mains, frequency_tolerance)
    is_image, resampled = _image_mask(frequencies, frequency_tolerance)
    is_unclear = ~is_mains & ~is_image & (frequencies < (np.inf if bandwidth is None else bandwidth))
    power_indices = np.unique(line_indices[is_unclear, None] + np.arange(-LEAKAGE, LEAKAGE + 1))
    share = float(np.sum(power[power_indices]) / max(np.sum(power), np.finfo(float).tiny))
    hum, others = (tuple(frequencies[which].tolist()) for which in (is_mains & ~is_image, is_unclear))
    return Lines(hum, others, share, resampled)


def _line_indices(power: FloatArray, neighbors: int) -> IndexArray:
    """Return the indices of lines among frequencies with this number of neighbors on both sides."""
    windows = np.lib.stride_tricks.sliding_window_view(power, neighbors)
    starts = range(0, len(windows), BLOCK_FREQUENCIES)
    medians = np.concatenate([np.median(windows[at : at + BLOCK_FREQUENCIES], axis=1) for at in starts])
    center = np.arange(neighbors + LEAKAGE, len(power) - neighbors - LEAKAGE)
    below = medians[center - neighbors - LEAKAGE]
    # In a steeply falling spectrum the lower side has the larger median.
    neighbor_median = np.maximum(below, medians[center + LEAKAGE + 1])
    line_power = power[center]
    is_peak = (line_power >= power[center - 1]) & (line_power >= power[center + 1])
    return np.asarray(center[is_peak & (line_power > LINE_RATIO * neighbor_median)])


def _side_band_mask(frequencies: FloatArray, mains: BoolArray, near: float) -> BoolArray:
    """Return the mask of pairs about a line of mains: side bands of hum with varying amplitude."""
    is_side_band = np.zeros(len(frequencies), dtype=bool)
    for mains_frequency in frequencies[mains]:
        mirrored = 2 * mains_frequency - frequencies
        is_side_band |= np.any(np.abs(frequencies[:, None] - mirrored) < near, axis=1)
    return is_side_band


def _image_mask(frequencies: FloatArray, near: float) -> tuple[BoolArray, float]:
    """Return the mask of images left by resampling, and the original rate, Hz; 0 without images.

    Interpolation of samples of another rate repeats the motion's lines on both sides of multiples of that
    rate. Images are pairs about a rate and about its double.
    """
    first, second = np.triu_indices(len(frequencies), 1)
    is_far = (frequencies[first] + frequencies[second]) > FAR * (frequencies[second] - frequencies[first])
    first, second = first[is_far], second[is_far]
    middles = (frequencies[first] + frequencies[second]) / 2
    distances = (frequencies[second] - frequencies[first]) / 2
    is_image, rates = np.zeros(len(frequencies), dtype=bool), []
    for rate, rate_distance in zip(middles, distances, strict=True):
        multiple = np.round(middles / rate)
        is_equal = (np.abs(middles - multiple * rate) < near) & (np.abs(distances - rate_distance) < near)
        if np.any(is_equal & (multiple == 2)):
            rates.append(float(rate))
            is_image[first[is_equal]] = is_image[second[is_equal]] = True
    return is_image, min(rates, default=0.0)


def is_rounding(row: FloatArray, residual: FloatArray) -> bool:
    """Return whether rounding to steps of an encoder explains a residual; it has lines at constant velocity.

    Args:
        row: recorded samples, (samples,).
        residual: sample minus fit, (samples,).
    """
    values = np.unique(row)
    step = float(np.diff(values).min())
    counts = (values - values[0]) / step
    multiples = bool(np.all(np.abs(counts - np.round(counts)) < STEP_TOLERANCE))
    return multiples and bool(np.mean(residual**2) <= ROUNDING_RATIO * step**2 / 12)


def _mains_mask(frequencies: FloatArray) -> BoolArray:
    is_mains = np.zeros(len(frequencies), dtype=bool)
    for mains in MAINS:
        harmonic = mains * np.round(frequencies / mains)
        is_mains |= (harmonic > 0) & (np.abs(frequencies - harmonic) < MAINS_RTOL * frequencies)
    return is_mains


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
    loud_octaves = np.flatnonzero(density >= density.max() / FALL)
    is_falling = density[loud_octaves[-1] : -1] > FALL * density[loud_octaves[-1] + 1 :]
    last_octave = int(loud_octaves[-1] + (len(is_falling) if is_falling.all() else np.argmin(is_falling)))
    first_octave = int(loud_octaves[0])
    if np.ptp(loud_octaves) >= BROADEST or last_octave == loud_octaves[-1]:
        return None
    step = 1 / float(time[-1] - time[0])
    middle_frequencies = step * np.sqrt(2) * edges[first_octave:last_octave]
    missed_power = edges[first_octave:last_octave] * (
        density[first_octave:last_octave] - density[last_octave]
    )
    return LeftOutMotion(middle_frequencies, missed_power, float(step * edges[last_octave]))
