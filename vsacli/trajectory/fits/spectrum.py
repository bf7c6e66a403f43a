"""Filtered noise that a fit follows, detected in the spectrum of its highest derivative.

Below the cut-off of a steep low-pass, random noise is as smooth as a motion, and a spline follows both. In
the spectrum of the samples such noise is a plateau, from the frequency where motion falls below it to the
cut-off. In the spectrum of the k-th derivative, which is f^2k times as large, it is a second hump after a
valley. Motion makes humps, too: sines are lines, steps of velocity are bursts in time, and between the parts
of a motion the spectrum of the samples rises again. A hump counts as noise if it is none of these.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.trajectory.fits.least_squares import fit_spline, most_spans

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


SEGMENT_SAMPLES, MAX_STRETCHES = 16384, 8
"""Most samples of a spectrum, and most stretches of a longer recording with a spectrum each."""

FIRST_LINE = 4
"""Lowest frequency of the bands, in cycles per stretch."""

BAND, HALF_WIDTH, LEAST_LINES = 0.04, 0.12, 7
"""Width of a band, and range of its median on both sides, relative to its frequency; fewest lines of the
spectrum in that range on each side, so that a sine does not change the median."""

RISE = 4.0
"""Smallest rise of the derivative's density from a valley to both sides. Medians of fifteen lines of noise
differ by less than a factor of 2.2 in 19 of 20 cases."""

MAX_CUTOFF_POWER = 1e-4
"""Largest share of the samples' power of noise at the cut-off of a filter that rings; more is motion."""

STEEP = 4
"""Power of the frequency by which the derivative is weighted, so that it is largest at such a cut-off."""

NO_RISE = 4.0
"""Largest rise of the samples' density beyond a valley; that of filtered noise does not rise."""

SMALL = 0.01
"""Largest share of the samples' power of noise that hides the motion in the derivative, so that there is no
valley: it is still small compared with the motion itself."""

FLAT = 0.2
"""Smallest density of the samples at the top of such noise, over that at its start; for motion it falls.
From a start below a fifth of the top's frequency on, it may fall as fast as that grows."""

HUMP = 0.1
"""Smallest density of the lines of a hump, over its largest density."""

FEWEST_LINES, FEW_LINES = 16, 12
"""Fewest lines of a hump that can be distinguished from a few sines; fewest of a high hump."""

PEAKED = 2.5
"""Power of a hump over that of its medians above which it consists of sines."""

SCATTER = (0.6, 1.8)
"""Range of the standard deviation of a hump's log power about the medians; Gaussian noise has 1.28."""

BURSTS, RESTING = 5.0, 15.0
"""Kurtosis over time above which a hump consists of bursts, and the same for a high hump; Gaussian noise has
3. Noise of an encoder stops when the joint rests, which is allowed for a high hump."""

HIGH = 30.0
"""Smallest rise of a high hump; its square if there is no motion in the bands below. Humps of a smooth motion
rose by 6, and by 550 beyond the slowest lines."""

EDGE, BEFORE_EDGE, BEYOND_EDGE = 1e-3, 0.93, 1.25
"""Largest density of the samples beyond the edge of a steep filter, where a hump ends, over that at the edge;
frequencies before and beyond the edge, over its own. At the edge the filter rings like a sine: lines before
it decide whether the hump is random."""

LINE_RATIO = 30.0
"""Ratio of the power of a line to the medians near it above which it is motion."""

TAPERED = 10
"""Inverse of the share of a stretch at each end where the window is too small to divide by."""

DEGREE, SPANS_PER_PERIOD = 7, 2.8
"""Degree of a spline that follows the motion alone, and spans per period of the motion's highest
frequency. Of such a sine 1 % is left, and of noise most from 1.4 times that frequency on."""

TRANSIENT = 4.0
"""Duration of the transient of a filter at an end, unless it rings, in periods of the frequency at which the
density of noise is largest, its cut-off."""


BAND_POWER_SHARE = 0.99
"""Share of a derivative's power within its band."""

MIN_MOTION_SHARE = 0.01
"""Smallest share of a derivative's power that counts as motion."""


class FollowedNoise(NamedTuple):
    """Random noise in the highest derivative of a fit.

    Attributes:
        share: root mean square of the noise over that of the derivative.
        above: frequency above which noise exceeds the motion, Hz.
        peak: frequency at which the density of the noise is largest, Hz.
    """

    share: float = 0.0
    above: float = np.inf
    peak: float = np.inf

    @property
    def relative(self) -> float:
        """Root mean square over that of the derivative without the noise."""
        return float(self.share / np.sqrt(max(1 - self.share**2, MIN_MOTION_SHARE)))

    @property
    def transient(self) -> float:
        """Time after which the transient of the filter at an end is over, s; 0 without noise."""
        return TRANSIENT / self.peak

    def covariance(self, orders: int) -> FloatArray:
        """Return the covariance of value and derivatives, (orders, orders), over the highest one's power.

        The density of the noise is flat up to its peak.
        """
        rate, order = 2 * np.pi * self.peak, orders - 1
        order_sums = np.add.outer(np.arange(orders), np.arange(orders))
        phase = np.cos(np.pi / 2 * np.subtract.outer(np.arange(orders), np.arange(orders)))
        return np.asarray(
            self.share**2 * phase * (2 * order + 1) / (order_sums + 1) * rate ** (order_sums - 2.0 * order)
        )

    def stretched(self, factor: float) -> FollowedNoise:
        """Return the noise for the motion slowed down by a factor."""
        return FollowedNoise(self.share, self.above / factor, self.peak / factor)


class _Spectrum(NamedTuple):
    """The spectrum of a derivative, in stretches of a recording.

    Attributes:
        frequency: frequencies of the lines, Hz, (lines,).
        lines: complex lines, with a Hann window, (stretches, lines).
        power: power of each line, (stretches, lines).
        weight: ratio f^2k of the derivative's density to that of the samples, (lines,).
        samples: number of samples of a stretch.
    """

    frequency: FloatArray
    lines: NDArray[np.complex128]
    power: FloatArray
    weight: FloatArray
    samples: int


class _Bands(NamedTuple):
    """Medians of a spectrum in bands, robust to sines and gaps between them.

    Attributes:
        line: index of the line in the middle of each band, (bands,).
        width: number of lines of each band, (bands,).
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
    *,
    rings: bool = False,
) -> FollowedNoise:
    """Find filtered noise in a derivative of a spline; none is found in fewer than about a hundred samples.

    Args:
        spline: spline near or through the samples, with one column.
        inside: first and last time with reliable derivatives, s.
        step: mean sampling interval, s.
        order: order of the derivative.
        bandwidth: frequency up to which humps are motion, Hz; None if unknown.
        rings: whether a steep filter rings at an end, so that there is noise below its cut-off.
    """
    time = _stretches(inside, step)
    spectrum = _spectrum(spline, time, step, order)
    total_power = float(np.sum(spectrum.power))
    if not total_power or spectrum.lines.shape[1] <= 2 * (FIRST_LINE + FEWEST_LINES):
        return FollowedNoise()
    bands, motion = _bands(spectrum), _power_of_motion(spline, time, order)
    noise = _noise_below_cutoff(spectrum, bands, motion) if rings and bandwidth is None else FollowedNoise()
    # Of several humps of noise, the one from the lowest valley on includes all others.
    is_valley, is_descending = _valley_masks(bands, motion)
    for valley in np.flatnonzero(is_valley).tolist():
        top = valley + int(np.argmax(bands.derivative[valley:]))
        peak = float(spectrum.frequency[bands.line[top]])
        fall = bands.samples[top] / bands.samples[valley]
        is_flat = is_descending[valley] or fall > min(FLAT, bands.line[valley] / bands.line[top])
        if is_flat and peak > (bandwidth or 0) and _is_noise(spectrum, bands, valley, top):
            power = float(np.sum((bands.width * bands.derivative)[valley:])) * len(spectrum.lines)
            above = _end_of_motion(spectrum, bands, valley, top)
            noise = max(noise, FollowedNoise(float(np.sqrt(min(1.0, power / total_power))), above, peak))
            break
    if not noise.share:
        return noise
    grid = np.linspace(*inside, SEGMENT_SAMPLES)
    row = spline(grid, nu=order)[:, 0]
    spans = min(
        int(SPANS_PER_PERIOD * noise.above * (inside[1] - inside[0])) + 1, most_spans(len(grid), DEGREE)
    )
    residual = row - fit_spline(grid, row[None], spans, DEGREE)(grid)[:, 0]
    # Unlike the window of a spectrum, this includes what a transient of the filter adds near the ends.
    return noise._replace(share=max(noise.share, float(np.std(residual) / np.sqrt(np.mean(row**2)))))


def motion_band(
    spline: BSpline[np.float64],
    inside: tuple[float, float],
    step: float,
    order: int,
    below: float = np.inf,
) -> float:
    """Return the frequency below which 99 % of the power of a derivative lies, Hz; NaN at rest.

    Args:
        spline: spline near or through the samples, with one column.
        inside: first and last time with reliable derivatives, s.
        step: mean sampling interval, s.
        order: order of the derivative.
        below: frequency above which there is noise, Hz.
    """
    spectrum = _spectrum(spline, _stretches(inside, step), step, order)
    power = np.where(spectrum.frequency < below, np.sum(spectrum.power, axis=0), 0.0)
    cumulative_power = np.cumsum(power)
    return (
        float(spectrum.frequency[np.searchsorted(cumulative_power, BAND_POWER_SHARE * cumulative_power[-1])])
        if cumulative_power[-1]
        else np.nan
    )


def _stretches(inside: tuple[float, float], step: float) -> FloatArray:
    """Return the times of stretches spread over a recording, (stretches, samples), s."""
    first, last = inside
    samples = int((last - first) / step) + 1
    count = max(2, min(samples, SEGMENT_SAMPLES))
    stretches = 1 if samples == count else min(MAX_STRETCHES, samples // count)
    starts = np.linspace(first, last - (count - 1) * step, stretches)
    return np.asarray(starts[:, None] + step * np.arange(count))


def _spectrum(spline: BSpline[np.float64], time: FloatArray, step: float, order: int) -> _Spectrum:
    samples = time.shape[1]
    lines = np.fft.rfft(np.hanning(samples) * spline(time, nu=order)[..., 0])
    frequency = np.asarray(np.fft.rfftfreq(samples, step), dtype=np.float64)
    weight = np.maximum(frequency, frequency[1]) ** (2 * order)
    return _Spectrum(frequency, lines, np.abs(lines) ** 2, weight, samples)


def _power_of_motion(spline: BSpline[np.float64], time: FloatArray, order: int) -> float:
    """Return the mean power of a stretch's samples about their mean, as density times number of lines."""
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
        half_width = max(LEAST_LINES, int(HALF_WIDTH * middle))
        near_density = density[:, max(1, middle - half_width) : middle + half_width + 1]
        medians[band] = np.median(near_density) / np.log(
            2
        )  # mean of an exponential distribution by its median
    medians = np.maximum(medians, np.finfo(float).tiny)
    slowest = float(np.mean(spectrum.power[:, 1:FIRST_LINE], axis=0).max())
    return _Bands(line, count, medians, medians * spectrum.weight[line], slowest)


def _noise_below_cutoff(spectrum: _Spectrum, bands: _Bands, motion: float) -> FollowedNoise:
    """Return the noise of a filter that rings: white up to the cut-off, if there is no motion there."""
    frequency = spectrum.frequency[bands.line]
    top = int(np.argmax(bands.derivative * frequency**STEEP))
    half_width = max(LEAST_LINES, int(HALF_WIDTH * (cutoff_line := int(bands.line[top]))))
    near_lines = slice(max(1, cutoff_line - half_width), cutoff_line + half_width + 1)
    density = float(
        np.mean(spectrum.power[:, near_lines] / spectrum.weight[near_lines])
    )  # more than medians: it peaks
    if cutoff_line * density > MAX_CUTOFF_POWER * motion:
        return FollowedNoise()
    power = density * np.sum(spectrum.weight[: cutoff_line + 1]) / np.sum(spectrum.power.mean(axis=0))
    above = frequency[np.argmax(bands.samples <= NO_RISE * density)]
    return FollowedNoise(float(np.sqrt(min(1.0, power))), float(above), float(frequency[top]))


def _valley_masks(bands: _Bands, motion: float) -> tuple[BoolArray, BoolArray]:
    """Return the bands from which on the derivative's density rises while the samples' does not.

    Returns:
        Mask of these bands, (bands,), and mask of bands to which the derivative's density descends, (bands,);
        below others, noise hides the motion.
    """
    density, samples = bands.derivative, bands.samples
    lowest_nearby = np.lib.stride_tricks.sliding_window_view(
        np.pad(density, 2, constant_values=np.inf), 5
    ).min(axis=1)
    max_above, max_samples_above = (np.maximum.accumulate(rows[::-1])[::-1] for rows in (density, samples))
    max_below = np.maximum(np.maximum.accumulate(density), bands.slowest)
    power_above = np.cumsum((bands.width * samples)[::-1])[::-1]
    is_descending: BoolArray = max_below >= RISE * density
    may_begin = is_descending | (power_above <= SMALL * motion)
    is_valley: BoolArray = (
        (density <= lowest_nearby)
        & may_begin
        & (max_above >= RISE * density)
        & (max_samples_above <= NO_RISE * samples)
    )
    return is_valley, is_descending


def _medians(spectrum: _Spectrum, bands: _Bands, first: int, last: int) -> FloatArray:
    """Return the median density of the derivative at lines first..last-1."""
    samples = np.interp(np.arange(first, last), bands.line, np.log(bands.samples))
    return np.asarray(np.exp(samples) * spectrum.weight[first:last])


def _end_of_motion(spectrum: _Spectrum, bands: _Bands, valley: int, top: int) -> float:
    """Return the frequency, Hz, of a valley, or of a later line of motion, which medians ignore."""
    first, last = int(bands.line[valley]), _last_line_before_edge(bands, top) + 1
    power = spectrum.power[:, first:last].mean(axis=0)
    lines = np.flatnonzero(power > LINE_RATIO * _medians(spectrum, bands, first, last))
    return float(spectrum.frequency[first + (int(lines[-1]) if lines.size else 0)])


def _last_line_before_edge(bands: _Bands, top: int) -> int:
    """Return the last line of a hump, or the last before the edge of a steep filter that ends it."""
    line = int(bands.line[top])
    band_beyond = int(np.searchsorted(bands.line, BEYOND_EDGE * line))
    is_steep = band_beyond < len(bands.line) and bands.samples[band_beyond] < EDGE * bands.samples[top]
    return int(BEFORE_EDGE * line) if is_steep else line


def _is_noise(spectrum: _Spectrum, bands: _Bands, valley: int, top: int) -> bool:
    """Return whether the hump beyond a valley is random, and present all the time."""
    density = bands.derivative
    motion = np.max(density[:valley], initial=0.0)
    rise = density[top] / density[valley]
    is_high = rise > (HIGH if motion > RISE * density[valley] else HIGH**2)
    first, last = int(bands.line[valley]), _last_line_before_edge(bands, top)
    if last == bands.line[top] or last - first < LEAST_LINES:
        hump_bands = np.flatnonzero(density[valley:] >= HUMP * density[top]) + valley
        first, last = int(bands.line[hump_bands[0]]), int(bands.line[hump_bands[-1]]) + 1
        if (last - first) * len(spectrum.power) < (FEW_LINES if is_high else FEWEST_LINES):
            return False
    power = spectrum.power[:, first:last]
    medians = _medians(spectrum, bands, first, last)
    scatter = np.std(np.log(np.maximum(power, np.finfo(float).tiny) / medians))
    if np.sum(power) > PEAKED * len(power) * np.sum(medians) or not SCATTER[0] < scatter < SCATTER[1]:
        return False
    lines = np.zeros_like(spectrum.lines)
    lines[:, first:last] = spectrum.lines[:, first:last]
    taper = max(1, spectrum.samples // TAPERED)
    window = np.hanning(spectrum.samples)[taper:-taper]
    hump_over_time = np.fft.irfft(lines, spectrum.samples)[:, taper:-taper] / window
    return bool(
        np.mean(hump_over_time**4) < (RESTING if is_high else BURSTS) * np.mean(hump_over_time**2) ** 2
    )


PROBES = 8192
"""Number of times at which a derivative is evaluated."""

MIN_RINGING_RATIO = 3.0
"""Smallest peak of an end that rings, over the largest derivative in the middle half. The fourth derivative
of a polynomial of degree 7 from rest to rest has 2.7."""

MIN_SHORT_RINGING_RATIO = 9.0
"""The same for an end that may be longer, or turn less; those of a sweep from 0.2 to 4 Hz have 4."""

MIN_SIGN_CHANGES = 3
"""Fewest changes of sign of an end that rings; a motion that starts at once has less."""

MAX_RINGING_SHARE = 0.75
"""Longest end that rings, in quarters of a recording; a sweep fills the last one."""

MAX_DECAY_RATIO = 0.5
"""Largest peak in the last quarter of an end that rings, over its peak; a motion from rest to rest ends as it
begins."""


def ringing_ends(spline: BSpline[np.float64], inside: tuple[float, float], order: int) -> tuple[float, float]:
    """Return how long both ends ring, s, by three neighboring derivatives; 0 without ringing.

    Args:
        spline: spline near or through the samples, with one column.
        inside: first and last time with reliable derivatives, s.
        order: order of the highest derivative that is needed.
    """
    time = np.linspace(*inside, PROBES)
    derivatives = [spline(time, nu=near)[:, 0] for near in (order - 1, order, order + 1)]
    probes = max(_ringing_probes(inward) for row in derivatives for inward in (row, row[::-1]))
    return (probes * float(time[1] - time[0]),) * 2


def _ringing_probes(inward: FloatArray) -> int:
    """Return the number of probes of a derivative, from the first on, that ring."""
    middle_peak = float(np.abs(inward[PROBES // 4 : -PROBES // 4]).max())
    large_indices = np.flatnonzero(np.abs(inward[: PROBES // 4]) > middle_peak)
    if not large_indices.size:
        return 0
    end_values = inward[: int(large_indices[-1]) + 1]
    magnitudes, sign_changes = np.abs(end_values), np.count_nonzero(np.diff(np.sign(end_values)))
    is_decaying = magnitudes[-len(end_values) // 4 :].max() < MAX_DECAY_RATIO * magnitudes.max()
    is_large = (
        sign_changes >= MIN_SIGN_CHANGES - 1 and magnitudes.max() > MIN_SHORT_RINGING_RATIO * middle_peak
    )
    is_ringing = (
        sign_changes >= MIN_SIGN_CHANGES
        and magnitudes.max() > MIN_RINGING_RATIO * middle_peak
        and len(end_values) < MAX_RINGING_SHARE * PROBES / 4
    )
    return len(end_values) if is_decaying and (is_large or is_ringing) else 0
