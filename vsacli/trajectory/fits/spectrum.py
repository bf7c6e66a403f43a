"""Noise that a fit follows since a filter made it smooth: the spectrum of the highest derivative shows it.

Below the cut-off of a steep low-pass, random noise is as smooth as a motion, and a spline follows both. In
the spectrum of the samples it is a plateau, from where motion falls below it to the cut-off. In that of the
k-th derivative, which grows by f^2k, it is a second hump behind a valley. Motion makes humps, too: sines are
lines, steps of velocity are bursts in time, and between the parts of a motion the spectrum of the samples
rises again. A hump counts as noise if it is none of these.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

SEGMENT_SAMPLES, MOST_SEGMENTS = 16384, 8
"""Samples of a spectrum, and stretches of a longer record that have one."""

FIRST_LINE = 4
"""Lowest frequency that is looked at, in cycles of a stretch."""

BAND, HALF_WIDTH, LEAST_LINES = 0.04, 0.12, 7
"""Width of a band, and to how far on both sides its median is taken, relative to its frequency; at least so
many lines of a spectrum on both sides, so that no line of a sine moves it."""

RISE = 4.0
"""Rise of the derivative's density from a valley to both sides. Medians of fifteen lines of noise differ by
less than a factor of 2.2 in 19 of 20 cases."""

NO_RISE = 4.0
"""Factor by which the density of the samples may rise beyond a valley: that of filtered noise does not."""

SMALL = 0.01
"""Share of the samples' power that noise may have which hides the motion in the derivative, so that there is
no valley: it still is small beside the motion itself."""

FLAT = 0.2
"""Density of the samples at the top of such noise relative to where it begins; that of motion falls."""

HUMP = 0.1
"""Share of the largest density of a hump that its lines have at least."""

FEWEST_LINES, FEW_LINES = 16, 12
"""Lines of a hump that is distinguished from a few sines; of a high hump."""

PEAKED = 2.5
"""Power of a hump over its medians, from which on lines make it up."""

SCATTER = (0.6, 1.8)
"""Standard deviation of the logarithms of a hump's lines about their medians; 1.28 of Gaussian noise."""

BURSTS, RESTING = 5.0, 15.0
"""Kurtosis of a hump's course in time from which on it happens now and then; 3 of Gaussian noise. That of an
encoder rests when the joint does, which a high hump may."""

HIGH = 30.0
"""Rise of a high hump; the square of it, if no motion is seen in the bands below. Humps of a smooth motion
were seen to rise by 6, and by 550 beyond the slowest lines."""

LINE_RATIO = 30.0
"""Ratio of the power of a line to the medians near it, from which on it is motion."""

TAPERED = 10
"""Share of a stretch at each end, one over this, where a window is too small to be undone."""


WITHIN = 0.99
"""Share of a derivative's power that its band has."""

LEAST_REST = 0.01
"""Share of a derivative's power that is taken for motion at least."""


class FollowedNoise(NamedTuple):
    """Random noise in the highest derivative of a fit.

    Attributes:
        share: of the derivative's root mean square.
        above: frequency above which it is more than the motion, Hz.
        peak: frequency at which its density is largest, Hz.
    """

    share: float = 0.0
    above: float = np.inf
    peak: float = np.inf

    @property
    def relative(self) -> float:
        """Root mean square relative to that of the derivative without it."""
        return float(self.share / np.sqrt(max(1 - self.share**2, LEAST_REST)))

    def stretched(self, factor: float) -> FollowedNoise:
        """Return the noise of the same motion, slower by a factor."""
        return FollowedNoise(self.share, self.above / factor, self.peak / factor)


class _Spectrum(NamedTuple):
    """The spectrum of a derivative, in stretches of a recording.

    Attributes:
        frequency: of the lines, Hz.
        lines: complex, weighted by a Hann window, (stretches, lines).
        power: of each line, (stretches, lines).
        weight: f^2k by which the density of the derivative exceeds that of the samples, (lines,).
        samples: of a stretch.
    """

    frequency: FloatArray
    lines: NDArray[np.complex128]
    power: FloatArray
    weight: FloatArray
    samples: int


class _Bands(NamedTuple):
    """Medians of a spectrum that neither lines nor gaps between them move.

    Attributes:
        line: index of the line in the middle of each band, (bands,).
        width: number of lines of each, (bands,).
        samples: density of the samples, (bands,).
        derivative: density of the derivative, (bands,).
        slowest: largest density of the derivative in the lines below all bands.
    """

    line: IndexArray
    width: IndexArray
    samples: FloatArray
    derivative: FloatArray
    slowest: float


def followed_noise(
    spline: BSpline[np.float64],
    inside: tuple[float, float],
    step: float,
    order: int,
    bandwidth: float | None = None,
) -> FollowedNoise:
    """Find filtered noise in a derivative of a spline; fewer than some hundred samples show none.

    Args:
        spline: near or through the samples, with one column.
        inside: first and last time of the stretch that is not doubtful, s.
        step: mean distance of samples, s.
        order: of the derivative.
        bandwidth: up to which there is motion, Hz, if it is known: what is below is no noise.
    """
    time = _stretches(inside, step)
    spectrum = _spectrum(spline, time, step, order)
    total = float(np.sum(spectrum.power))
    if not total or spectrum.lines.shape[1] <= 2 * (FIRST_LINE + FEWEST_LINES):
        return FollowedNoise()
    bands = _bands(spectrum)
    # of several humps that pass for noise the one from the lowest valley on has them all
    valleys, descends = _valleys(bands, _power_of_motion(spline, time, order))
    for valley in np.flatnonzero(valleys).tolist():
        top = valley + int(np.argmax(bands.derivative[valley:]))
        peak = float(spectrum.frequency[bands.line[top]])
        steady = descends[valley] or bands.samples[top] > FLAT * bands.samples[valley]
        known = bandwidth is not None and peak <= bandwidth
        if steady and not known and _is_noise(spectrum, bands, valley, top):
            power = float(np.sum((bands.width * bands.derivative)[valley:])) * len(spectrum.lines)
            above = _end_of_motion(spectrum, bands, valley, top)
            return FollowedNoise(float(np.sqrt(min(1.0, power / total))), above, peak)
    return FollowedNoise()


def motion_band(
    spline: BSpline[np.float64],
    inside: tuple[float, float],
    step: float,
    order: int,
    below: float = np.inf,
) -> float:
    """Return the frequency up to which 99 % of the power of a derivative lies, Hz; NaN at rest.

    Args:
        spline: near or through the samples, with one column.
        inside: first and last time of the stretch that is not doubtful, s.
        step: mean distance of samples, s.
        order: of the derivative.
        below: frequency from which on it is noise, Hz.
    """
    spectrum = _spectrum(spline, _stretches(inside, step), step, order)
    power = np.where(spectrum.frequency < below, np.sum(spectrum.power, axis=0), 0.0)
    summed = np.cumsum(power)
    return float(spectrum.frequency[np.searchsorted(summed, WITHIN * summed[-1])]) if summed[-1] else np.nan


def _stretches(inside: tuple[float, float], step: float) -> FloatArray:
    """Return times of stretches all over a recording, (stretches, samples), s."""
    first, last = inside
    samples = int((last - first) / step) + 1
    count = max(2, min(samples, SEGMENT_SAMPLES))
    stretches = 1 if samples == count else min(MOST_SEGMENTS, samples // count)
    starts = np.linspace(first, last - (count - 1) * step, stretches)
    return np.asarray(starts[:, None] + step * np.arange(count))


def _spectrum(spline: BSpline[np.float64], time: FloatArray, step: float, order: int) -> _Spectrum:
    samples = time.shape[1]
    lines = np.fft.rfft(np.hanning(samples) * spline(time, nu=order)[..., 0])
    frequency = np.asarray(np.fft.rfftfreq(samples, step), dtype=np.float64)
    weight = np.maximum(frequency, frequency[1]) ** (2 * order)
    return _Spectrum(frequency, lines, np.abs(lines) ** 2, weight, samples)


def _power_of_motion(spline: BSpline[np.float64], time: FloatArray, order: int) -> float:
    """Return the power of the samples about their mean, of a stretch, as density times number of lines."""
    values = spline(time)[..., 0]
    power = np.abs(np.fft.rfft(np.hanning(time.shape[1]) * (values - values.mean()))) ** 2
    return (2 * np.pi) ** (2 * order) * float(np.sum(power)) / len(time)


def _bands(spectrum: _Spectrum) -> _Bands:
    end = len(spectrum.frequency)
    edges = [FIRST_LINE]
    while edges[-1] < end:
        edges.append(max(edges[-1] + 1, int(edges[-1] * (1 + BAND))))
    edges[-1] = end
    starts, count = np.array(edges[:-1]), np.diff(edges)
    line = starts + (count - 1) // 2
    density = spectrum.power / spectrum.weight
    medians = np.empty(len(line))
    for band, middle in enumerate(line.tolist()):
        reach = max(LEAST_LINES, int(HALF_WIDTH * middle))
        near = density[:, max(1, middle - reach) : middle + reach + 1]
        medians[band] = np.median(near) / np.log(2)  # the mean of what is exponentially distributed
    medians = np.maximum(medians, np.finfo(float).tiny)
    slowest = float(np.mean(spectrum.power[:, 1:FIRST_LINE], axis=0).max())
    return _Bands(line, count, medians, medians * spectrum.weight[line], slowest)


def _valleys(bands: _Bands, motion: float) -> tuple[BoolArray, BoolArray]:
    """Return bands from which the derivative's density rises and the samples' does not, (bands,).

    Returns:
        These, and those to which the derivative's density descends; to others motion is hidden by the noise.
    """
    here, samples = bands.derivative, bands.samples
    near = np.lib.stride_tricks.sliding_window_view(np.pad(here, 2, constant_values=np.inf), 5).min(axis=1)
    above, later = (np.maximum.accumulate(rows[::-1])[::-1] for rows in (here, samples))
    below = np.maximum(np.maximum.accumulate(here), bands.slowest)
    beyond = np.cumsum((bands.width * samples)[::-1])[::-1]
    descends: BoolArray = below >= RISE * here
    begins = descends | (beyond <= SMALL * motion)
    found: BoolArray = (here <= near) & begins & (above >= RISE * here) & (later <= NO_RISE * samples)
    return found, descends


def _medians(spectrum: _Spectrum, bands: _Bands, first: int, last: int) -> FloatArray:
    """Return the median density of the derivative at lines first..last-1."""
    samples = np.interp(np.arange(first, last), bands.line, np.log(bands.samples))
    return np.asarray(np.exp(samples) * spectrum.weight[first:last])


def _end_of_motion(spectrum: _Spectrum, bands: _Bands, valley: int, top: int) -> float:
    """Return the frequency, Hz, of a valley, or of a later line of motion, which medians pass over."""
    first, last = int(bands.line[valley]), int(bands.line[top]) + 1
    power = spectrum.power[:, first:last].mean(axis=0)
    lines = np.flatnonzero(power > LINE_RATIO * _medians(spectrum, bands, first, last))
    return float(spectrum.frequency[first + (int(lines[-1]) if lines.size else 0)])


def _is_noise(spectrum: _Spectrum, bands: _Bands, valley: int, top: int) -> bool:
    """Return whether the hump beyond a valley is random and lasts."""
    density = bands.derivative
    motion = np.max(density[:valley], initial=0.0)
    rise = density[top] / density[valley]
    high = rise > (HIGH if motion > RISE * density[valley] else HIGH**2)
    chosen = np.flatnonzero(density[valley:] >= HUMP * density[top]) + valley
    first, last = int(bands.line[chosen[0]]), int(bands.line[chosen[-1]]) + 1
    power = spectrum.power[:, first:last]
    if (last - first) * len(power) < (FEW_LINES if high else FEWEST_LINES):
        return False
    medians = _medians(spectrum, bands, first, last)
    scatter = np.std(np.log(np.maximum(power, np.finfo(float).tiny) / medians))
    if np.sum(power) > PEAKED * len(power) * np.sum(medians) or not SCATTER[0] < scatter < SCATTER[1]:
        return False
    lines = np.zeros_like(spectrum.lines)
    lines[:, first:last] = spectrum.lines[:, first:last]
    ends = max(1, spectrum.samples // TAPERED)
    window = np.hanning(spectrum.samples)[ends:-ends]
    course = np.fft.irfft(lines, spectrum.samples)[:, ends:-ends] / window
    return bool(np.mean(course**4) < (RESTING if high else BURSTS) * np.mean(course**2) ** 2)
