"""How fast a recorded motion is: the band that holds it, beyond which a record is nothing but noise."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray

ABOVE_NOISE = 30.0
"""Power of a line over the noise near the highest frequencies; no line of 1e6 of white noise reaches it."""

SLOW_SHARE = 1e-5
"""Share of the power of the velocity that may lie beyond the band: 0.3 % of its amplitude."""

FASTEST = 40.0
"""Hz beyond which no joint of a robot moves, while mains hum."""

ROOM = 1.5
"""Bandwidth of equations over the highest frequency of the motion, which passes but for 0.8 %. On the paper's
arm residuals were noise from a ratio of 1 on, and to beyond 10; the inertias gain a little up to 4."""

SLOWEST_SPANS = 12.0
"""Periods of the bandwidth that a record holds at least: filters leave out two at either end."""

SAMPLES = 8.0
"""Samples to a period of the bandwidth at least."""


def bandwidth_of(time: FloatArray, positions: FloatArray) -> float:
    """A bandwidth for the equations of a record, Hz.

    Args:
        time: (samples,), s, in equal steps.
        positions: of joints and motors, (samples, columns), without NaN.
    """
    lowest, highest = bounds(time)
    edge = max(_highest_frequency(time, column) for column in positions.T)
    return float(np.clip(ROOM * edge, lowest, highest))


def bounds(time: FloatArray) -> tuple[float, float]:
    """Between which bandwidths of a record lie, Hz."""
    duration = float(time[-1] - time[0])
    return SLOWEST_SPANS / duration, (len(time) - 1) / duration / SAMPLES


def _highest_frequency(time: FloatArray, column: FloatArray) -> float:
    """Of what can be told from noise, but for a small share."""
    window = np.hanning(len(time))
    power = np.abs(np.fft.rfft(window * (column - np.mean(column)))) ** 2
    frequency = np.fft.rfftfreq(len(time), float(time[1] - time[0]))
    noise = np.median(power[len(power) // 2 :]) / np.log(2)  # of noise, powers are exponentially distributed
    there = (power > ABOVE_NOISE * noise) & (frequency <= FASTEST)
    beyond = np.cumsum((power * frequency**2 * there)[::-1])[::-1]
    faster = np.flatnonzero(beyond > SLOW_SHARE * beyond[0])
    return float(frequency[faster[-1]]) if faster.size else 0.0
