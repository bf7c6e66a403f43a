"""How fast a recorded motion is: the band that holds it, beyond which a record is nothing but noise."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray

ABOVE_NOISE = 30.0
"""Power of a line over the noise near the highest frequencies; no line of 1e6 of white noise reaches it."""

ROOM = 1.5
"""Bandwidth of equations over the highest frequency of the motion, which passes but for 0.8 %. On the paper's
arm residuals were noise from a ratio of 1 on, and to beyond 10; inertias gain a little up to 4."""

FASTEST = 20.0
"""Hz that the bandwidth has at most: joints move no faster, and mains hum lies well beyond the filters."""

LEAST_NOISE = 5e-5
"""Power of noise in the accelerations, over that of these, that the bandwidth lets through at most: the share
by which inertias come out too small."""

SLOWEST_SPANS = 12.0
"""Periods of the bandwidth that a record holds at least: filters leave out three at either end."""

SAMPLES = 8.0
"""Samples to a period of the bandwidth at least."""


def bandwidth_of(time: FloatArray, q: FloatArray, theta: FloatArray) -> float:
    """A bandwidth for the equations of a record, Hz.

    Args:
        time: (samples,), s, in equal steps.
        q: positions of joints, (samples, joints); NaN in columns that were not recorded.
        theta: of motors, (samples, joints, 2), likewise.
    """
    lowest, highest = bounds(time)
    positions = np.concatenate((q[..., None], theta), axis=-1).reshape(len(time), -1)
    recorded = positions[:, np.isfinite(positions).all(axis=0)]
    edges, ends = zip(*(_motion(time, column) for column in recorded.T), strict=True)
    return float(np.clip(min(ROOM * max(edges), min(ends), FASTEST), lowest, highest))


def bounds(time: FloatArray) -> tuple[float, float]:
    """Between which bandwidths of a record lie, Hz."""
    duration = float(time[-1] - time[0])
    return SLOWEST_SPANS / duration, (len(time) - 1) / duration / SAMPLES


def _motion(time: FloatArray, column: FloatArray) -> tuple[float, float]:
    """The highest frequency that can be told from noise, and that up to which accelerations can."""
    window = np.hanning(len(time))
    power = np.abs(np.fft.rfft(window * (column - np.mean(column)))) ** 2
    frequency = np.fft.rfftfreq(len(time), float(time[1] - time[0]))
    noise = white_noise(power)
    there = np.where((power > ABOVE_NOISE * noise) & (frequency <= FASTEST), power, 0.0)
    if not there.any():
        return 0.0, np.inf
    drowned = np.cumsum(noise * frequency**4) > LEAST_NOISE * np.sum(there * frequency**4)
    end = frequency[np.argmax(drowned)] if drowned.any() else np.inf
    return float(frequency[np.flatnonzero(there)[-1]]), float(end)


def white_noise(power: FloatArray) -> FloatArray:
    """Mean power of a line of white noise, from the upper half of a spectrum, (lines, ...).

    There half of the lines lie below ln 2 of the mean, as powers of noise are exponentially distributed.
    """
    return np.asarray(np.median(power[len(power) // 2 :], axis=0) / np.log(2))
