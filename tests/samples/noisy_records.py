"""Motions whose derivatives are known, recorded with noise of many colors."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from scipy.signal import butter, filtfilt, lfilter

DURATION = 10.0
"""Of a record, s."""

FREQUENCIES, AMPLITUDES = (0.3, 0.7, 1.1, 1.9), (0.8, 0.4, 0.2, 0.1)
"""Of a motion below 2 Hz, Hz and rad."""

DEVIATION = 1e-4
"""Of noise before it is filtered, rad."""

_bump = (Polynomial([0, 1]) * Polynomial([1, -1])) ** 4
BLEND = _bump.integ() / _bump.integ()(1)
"""From 0 to 1 with four derivatives that are zero at both ends."""

MINIMUM_JERK = Polynomial([0, 0, 0, 10, -15, 6])


class Record(NamedTuple):
    """Samples of a joint, and the truth.

    Attributes:
        time: (samples,), s.
        values: (samples,), with noise, rad.
        truth: the motion and its fourth derivative, (2, samples), rad and rad/s^4.
    """

    time: np.ndarray
    values: np.ndarray
    truth: np.ndarray


def sines(time, seed):
    """Four sines with phases of their own."""
    return _sum_of_sines(time, seed, FREQUENCIES)


def cyclic_sines(time, seed):
    """The same, with a period of one second."""
    return _sum_of_sines(time, seed, (1.0, 1.0, 2.0, 2.0))


def _sum_of_sines(time, seed, frequencies):
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, 4)[:, None]
    rates = 2 * np.pi * np.array(frequencies)[:, None]
    turns = np.sin(rates * time + phases)
    return np.array([AMPLITUDES @ turns, AMPLITUDES @ (rates**4 * turns)])


def pauses(time, seed):
    """From rest to rest with polynomials of degree 9, and pauses between."""
    return _rest_to_rest(time, seed, BLEND)


def minimum_jerk(time, seed):
    """From rest to rest with polynomials of degree 5: their fourth derivative has impulses."""
    return _rest_to_rest(time, seed, MINIMUM_JERK)


def _rest_to_rest(time, seed, blend):
    rng = np.random.default_rng(seed)
    value, fourth, start = np.zeros_like(time), np.zeros_like(time), 0.0
    while start < time[-1]:
        duration, size = rng.uniform(0.8, 2.0), rng.uniform(-1.2, 1.2)
        place = np.clip((time - start) / duration, 0, 1)
        value += size * blend(place)
        fourth += size * blend.deriv(4)(place) / duration**4 * ((place > 0) & (place < 1))
        start += duration + rng.uniform(0.2, 0.8)
    return np.array([value, fourth])


def velocity_steps(time, seed, duration=0.05):
    """Steps of the velocity, each smoothed over 50 ms."""
    rng = np.random.default_rng(seed)
    ramp, start = BLEND.integ(), 1.0
    value, fourth = np.zeros_like(time), np.zeros_like(time)
    while start < time[-1] - 1:
        size, place = rng.uniform(-1, 1), (time - start) / duration
        inside, after = np.clip(place, 0, 1), np.maximum(place - 1, 0)
        value += size * duration * (ramp(inside) + after)
        fourth += size * BLEND.deriv(3)(inside) / duration**3 * ((place > 0) & (place < 1))
        start += rng.uniform(0.6, 1.5)
    return np.array([value, fourth])


def slow_velocity_steps(time, seed):
    """Steps of the velocity, each smoothed over 200 ms."""
    return velocity_steps(time, seed, 0.2)


def sweep(time, seed):
    """A sine whose frequency grows from 0.2 to 4 Hz."""
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    growth = np.pi * (4.0 - 0.2) / time[-1]
    rate = 2 * np.pi * 0.2 + 2 * growth * time
    turn = 2 * np.pi * 0.2 * time + growth * time**2 + phase
    second = 2 * growth
    fourth = 0.5 * ((rate**4 - 3 * second**2) * np.sin(turn) - 6 * rate**2 * second * np.cos(turn))
    return np.array([0.5 * np.sin(turn), fourth])


def random_motion(time, seed):
    """A sum of sines with random amplitudes; its power falls by f^-14 beyond 0.7 Hz, that of d4q by f^-6."""
    rng, corner, period = np.random.default_rng(5000 + seed), 0.7, 2.5 * time[-1]
    frequencies = np.arange(1, int(20 * corner * period)) / period
    sizes = (1 + (frequencies / corner) ** 2) ** -3.5
    sizes *= 0.5 / np.linalg.norm(sizes)
    value, fourth = np.zeros_like(time), np.zeros_like(time)
    for frequency, size in zip(frequencies, sizes, strict=True):
        rate, (cosine, sine) = 2 * np.pi * frequency, size * rng.standard_normal(2)
        turn = cosine * np.cos(rate * time) + sine * np.sin(rate * time)
        value += turn
        fourth += rate**4 * turn
    return np.array([value, fourth])


MOTIONS: dict[str, Callable[[np.ndarray, int], np.ndarray]] = {
    "sines": sines,
    "rest to rest, pauses": pauses,
    "sweep to 4 Hz": sweep,
    "random": random_motion,
    "velocity steps, 200 ms": slow_velocity_steps,
    "velocity steps, 50 ms": velocity_steps,
    "minimum jerk": minimum_jerk,
}


def rounded(values, bits):
    """As an encoder gives them."""
    resolution = 2 * np.pi / 2**bits
    return resolution * np.round(values / resolution)


def first_order(white, correlation):
    """Noise with the same deviation, correlated from sample to sample."""
    return lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], white)


def twice_filtered(values, cutoff, rate):
    """Low-pass, forwards and backwards."""
    return filtfilt(*butter(2, 2 * cutoff / rate), values)


COLORS = {
    "white, 1e-4 rad": lambda q, e, _rate: q + e,
    "white, 1e-5 rad": lambda q, e, _rate: q + 0.1 * e,
    "12-bit encoder": lambda q, _e, _rate: rounded(q, 12),
    "17-bit encoder": lambda q, _e, _rate: rounded(q, 17),
    "first order 0.9": lambda q, e, _rate: q + first_order(e, 0.9),
    "first order 0.99": lambda q, e, _rate: q + first_order(e, 0.99),
    "causal low-pass, 30 Hz": lambda q, e, rate: q + lfilter(*butter(2, 60 / rate), e),
    "zero-phase low-pass, 50 Hz": lambda q, e, rate: q + twice_filtered(e, min(50, rate / 5), rate),
    "zero-phase low-pass, 20 Hz": lambda q, e, rate: q + twice_filtered(e, 20, rate),
    "12 bits, zero-phase 50 Hz": lambda q, _e, rate: twice_filtered(rounded(q, 12), min(50, rate / 5), rate),
    "12 bits, zero-phase 20 Hz": lambda q, _e, rate: twice_filtered(rounded(q, 12), 20, rate),
    "hum of 50 Hz": lambda q, e, rate: (
        q + DEVIATION * np.sin(2 * np.pi * 50 * np.arange(len(q)) / rate + 1) + 0.01 * e
    ),
}
"""Noise by name: what a record of q becomes with white noise e of deviation `DEVIATION` at a rate in Hz."""

WHITE = ("white, 1e-4 rad", "white, 1e-5 rad", "12-bit encoder", "17-bit encoder")

FILTERED = tuple(name for name in COLORS if "low-pass" in name or "zero-phase" in name)
"""Colors that neighboring samples hardly show."""


def record(motion, color, seed, rate=1000):
    """A record of a motion, with noise."""
    time = np.arange(round(DURATION * rate) + 1) / rate
    truth = motion(time, seed)
    white = DEVIATION * np.random.default_rng(100 + seed).standard_normal(len(time))
    return Record(time, COLORS[color](truth[0], white, rate), truth)
