"""Random recordings of one joint as laboratories make them.

A seed determines motion, noise, low-pass filter, sampling rate, duration and robot. Even seeds (0, 2, ...)
are the design half: constants may be chosen by what they show. Odd seeds are the unseen half: they judge, and
nothing is set by them.

A recording is half of a periodic signal, which is filtered whole. So the filter has no transients, and each
motion is a Fourier series: filtered, differentiated and sampled without error. The truth of a recording is
the *filtered noiseless* motion: the filter is the laboratory's choice, and no fit can undo it. Transients of
a filter that was run over a finite log would be such a distortion too, and are left out. The cut-off is at
least 1.5 times the highest frequency that the motion is drawn with.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from oracles.one_joint import Arm, least_stiffness

from samples.laboratory_filters import Filter, draw_filter
from samples.noisy_records import BLEND, MINIMUM_JERK

RATES = (100, 125, 200, 250, 400, 500, 800, 1000, 2000)
"""Hz."""

DURATIONS = (4.0, 20.0)
"""Range, s."""

LEVELS = (3e-5, 1e-3)
"""Range of the standard deviation of noise before the filter, rad; of a stiffness relative to its mean."""

NOISES = ("white", "first order", "encoder")

FASTEST, ABOVE = 8.0, 1.5
"""Highest frequency of a motion, Hz, and least ratio of the cut-off to it."""

SERIES_END = 90.0
"""Frequency up to which the Fourier series of a motion is used, Hz; with slow sampling 0.45 of the rate."""

PEAK_SPEED = 8.0
"""Of a motion, rad/s."""


class Noise(NamedTuple):
    """Random errors before the filter.

    Attributes:
        kind: of `NOISES`. The steps of an encoder are as large as noise of that deviation has them.
        level: standard deviation, rad; of a stiffness relative to its mean.
        correlation: from sample to sample, of the first order.
    """

    kind: str
    level: float
    correlation: float

    def density(self, frequencies: np.ndarray, rate: float) -> np.ndarray:
        """Return the power at frequencies in Hz: its mean up to half the rate is the variance."""
        if self.kind != "first order":
            return np.full(len(frequencies), self.level**2)
        turn = np.exp(-2j * np.pi * frequencies / rate)
        return self.level**2 * (1 - self.correlation**2) / np.abs(1 - self.correlation * turn) ** 2

    def added(self, rng: np.random.Generator, values: np.ndarray, rate: float) -> np.ndarray:
        """Return a period of samples with noise, or as an encoder reads them."""
        if self.kind == "encoder":
            step = np.sqrt(12) * self.level
            offset = rng.uniform()
            return step * (np.round(values / step + offset) - offset)
        spectrum = np.fft.rfft(rng.standard_normal(len(values)))
        color = np.sqrt(self.density(np.fft.rfftfreq(len(values), 1 / rate), rate))
        return values + np.fft.irfft(color * spectrum, len(values))


class Signal(NamedTuple):
    """A recorded signal and all that is true of it.

    Attributes:
        values: a period of samples as recorded, filtered and rounded; the recording is its first half.
        series: complex coefficients of the filtered noiseless motion, of `numpy.fft.rfft` of a period.
        gain: complex, of the filter, at the same frequencies.
        density: power of the noise before the filter, at the same frequencies.
        rounding: standard deviation of the rounding to the decimals of the file.
        frequencies: Hz.
    """

    values: np.ndarray
    series: np.ndarray
    gain: np.ndarray
    density: np.ndarray
    rounding: float
    frequencies: np.ndarray

    def derivatives(self, series: np.ndarray, orders: int) -> np.ndarray:
        """Return the value and derivatives of a series at the samples of the recording, (orders, samples)."""
        period = len(self.values)
        rows = [
            np.fft.irfft((2j * np.pi * self.frequencies) ** order * series, period) for order in range(orders)
        ]
        return np.array(rows)[:, : period // 2 + 1]

    @property
    def recorded(self) -> np.ndarray:
        """The samples of the recording."""
        return self.values[: len(self.values) // 2 + 1]


class Recording(NamedTuple):
    """One joint, recorded.

    Attributes:
        seed: that it was drawn with.
        rate: Hz.
        motion: name of the motion.
        filter: that was run over all signals.
        noise: of the position; that of a stiffness is of the same kind.
        arm: the robot.
        position: rad.
        stiffness: N m/rad; None of an arm that takes none.
        stiffness_recorded: whether the stiffness is a recording, rather than a constant.
    """

    seed: int
    rate: int
    motion: str
    filter: Filter
    noise: Noise
    arm: Arm
    position: Signal
    stiffness: Signal | None
    stiffness_recorded: bool

    @property
    def time(self) -> np.ndarray:
        """Stamps from zero on, s."""
        return np.arange(len(self.position.recorded)) / self.rate

    @property
    def facts(self) -> str:
        """How it was made, in words."""
        stiffness = ", stiffness recorded" if self.stiffness_recorded else ""
        springs = "two springs" if self.arm.antagonistic else "a spring"
        return (
            f"{self.motion}, {self.rate} Hz, {self.time[-1]:.3g} s, "
            f"{self.noise.kind} {self.noise.level:.1e} rad, "
            f"{self.filter}, {springs} of {self.arm.k:.3g} N m/rad{stiffness}"
        )

    @property
    def truth(self) -> tuple[np.ndarray, np.ndarray | None]:
        """Filtered noiseless position with four derivatives and stiffness with two, (orders, samples)."""
        stiffness = self.stiffness and self.stiffness.derivatives(self.stiffness.series, 3)
        return self.position.derivatives(self.position.series, 5), stiffness


Shape = Callable[[np.random.Generator, np.ndarray, float], np.ndarray]
"""A motion at evenly spread times of a period, from the highest frequency that it may have."""


def _sines(rng: np.random.Generator, time: np.ndarray, highest: float) -> np.ndarray:
    period = len(time) * time[1]
    turns = np.maximum(1, np.round(period * rng.uniform(0.1, highest, rng.integers(2, 6))))
    phases, sizes = rng.uniform(0, 2 * np.pi, len(turns)), rng.uniform(0.2, 1, len(turns)) / turns
    return sizes @ np.sin(2 * np.pi * turns[:, None] * time / period + phases[:, None])


def _slow_sines(rng: np.random.Generator, time: np.ndarray, highest: float) -> np.ndarray:
    return _sines(rng, time, min(1.0, highest))


def _rest_to_rest(
    rng: np.random.Generator, time: np.ndarray, highest: float, rise: Callable = BLEND
) -> np.ndarray:
    """From rest to rest with pauses, back to the first position at the end of the period."""
    period, value, level, start = len(time) * time[1], np.zeros_like(time), 0.0, 0.0
    shortest = min(max(0.6, 4 / highest), period / 16)
    while start < period:
        duration, pause = rng.uniform(shortest, 4 * shortest), rng.uniform(0, min(1.5, 2 * shortest))
        last = start + 2 * (duration + pause) > period
        duration, target = (period - start if last else duration), 0.0 if last else rng.uniform(-1, 1)
        value += (target - level) * rise(np.clip((time - start) / duration, 0, 1))
        level, start = target, start + duration + pause
    return value


def _minimum_jerk(rng: np.random.Generator, time: np.ndarray, highest: float) -> np.ndarray:
    return _rest_to_rest(rng, time, highest, MINIMUM_JERK)


def _sweep(rng: np.random.Generator, time: np.ndarray, highest: float) -> np.ndarray:
    """A sine whose frequency goes up within the recording and down again after it."""
    period, low = len(time) * time[1], rng.uniform(0.1, 0.3)
    middle = max(1, round(period * (low + highest) / 2))
    swing = period * (highest - low) / 2
    place = 2 * np.pi * time / period
    return np.sin(middle * place - swing * np.sin(place) + rng.uniform(0, 2 * np.pi))


def _random(rng: np.random.Generator, time: np.ndarray, highest: float) -> np.ndarray:
    """Gaussian, with all frequencies up to one from which on its power falls by f^-12."""
    frequencies = np.fft.rfftfreq(len(time), time[1])
    corner = rng.uniform(0.3, 0.5) * highest
    sizes = (1 + (frequencies / corner) ** 12) ** -0.5
    cosines, sines = rng.standard_normal((2, len(frequencies)))
    sizes[0] = 0
    return np.fft.irfft(sizes * (cosines + 1j * sines), len(time))


def _velocity_steps(rng: np.random.Generator, time: np.ndarray, highest: float) -> np.ndarray:
    """Ramps and pauses whose corners are rounded over the time of three periods of the highest frequency."""
    period = len(time) * time[1]
    width = max(0.2, 3 / highest)
    ends = np.sort(rng.uniform(0, period - width, max(3, round(period / (2 + width)))))
    steps = rng.uniform(-1, 1, len(ends))
    steps -= steps.mean()
    ramp = BLEND.integ()
    value = np.zeros_like(time)
    for end, step in zip(ends, steps, strict=True):
        place = (time - end) / width
        value += step * width * (ramp(np.clip(place, 0, 1)) + np.maximum(place - 1, 0))
    return value - value[-1] * BLEND(time / period)


SHAPES: dict[str, tuple[float, Shape]] = {
    "slow sines": (0.25, _slow_sines),
    "faster sines": (0.2, _sines),
    "rest to rest, pauses": (0.2, _rest_to_rest),
    "sweep": (0.05, _sweep),
    "random": (0.15, _random),
    "velocity steps": (0.1, _velocity_steps),
    "minimum jerk": (0.05, _minimum_jerk),
}
"""Share of the recordings, and motion, by name."""


def draw(seed: int) -> Recording:
    """Draw a recording."""
    rng = np.random.default_rng(seed)
    rate = int(rng.choice(RATES))
    period = 2 * round(rate * rng.uniform(*DURATIONS))
    through = draw_filter(rng, rate)
    gain = through.response(period, rate)
    cutoff = min((stage.cutoff for stage in through.stages), default=np.inf)
    highest = min(FASTEST, cutoff / ABOVE, rate / 10) * rng.uniform(0.3, 1)
    motion = str(rng.choice(list(SHAPES), p=[share for share, _ in SHAPES.values()]))
    noise = Noise(str(rng.choice(NOISES)), _logarithmic(rng, *LEVELS), float(rng.uniform(0.5, 0.98)))
    decimals = int(rng.choice([6, 7, 16]))
    exact = fourier_series(rng, motion, period, rate, highest)
    size = rng.uniform(0.2, 1.5) / np.ptp(np.fft.irfft(exact, period))
    exact *= min(size, PEAK_SPEED / np.abs(np.diff(np.fft.irfft(exact, period))).max() / rate)
    position = _signal(rng, exact, gain, noise, rate, decimals)
    arm, stiffness, recorded = _draw_arm(rng), None, False
    if arm.antagonistic:
        recorded = bool(rng.integers(3))
        stiffness = _stiffness(rng, arm, position, gain, noise, rate, decimals, recorded, highest)
    return Recording(seed, rate, motion, through, noise, arm, position, stiffness, recorded)


def _logarithmic(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def fourier_series(
    rng: np.random.Generator, motion: str, period: int, rate: int, highest: float
) -> np.ndarray:
    """Return the Fourier coefficients of a motion, sampled finely enough that none is aliased."""
    finer = max(1, round(1000 / rate))
    time = np.arange(finer * period) / (finer * rate)
    coefficients = np.fft.rfft(SHAPES[motion][1](rng, time, highest))[: period // 2 + 1] / finer
    coefficients[np.fft.rfftfreq(period, 1 / rate) > min(SERIES_END, 0.45 * rate)] = 0
    return coefficients


def _signal(
    rng: np.random.Generator, exact: np.ndarray, gain: np.ndarray, noise: Noise, rate: int, decimals: int
) -> Signal:
    period = 2 * (len(exact) - 1)
    frequencies = np.fft.rfftfreq(period, 1 / rate)
    noisy = noise.added(rng, np.fft.irfft(exact, period), rate)
    values = np.round(np.fft.irfft(gain * np.fft.rfft(noisy), period), decimals)
    rounding = 10.0**-decimals / np.sqrt(12)
    return Signal(values, gain * exact, gain, noise.density(frequencies, rate), rounding, frequencies)


def _draw_arm(rng: np.random.Generator) -> Arm:
    inertia, horizontal = _logarithmic(rng, 0.3, 2), bool(rng.integers(2))
    if rng.uniform() < 0.65:
        return Arm(inertia, _logarithmic(rng, 2, 300), 0.0, horizontal)
    size = _logarithmic(rng, 0.03, 1)
    return Arm(inertia, 400 * size, 2000 * size, horizontal)


def _stiffness(
    rng: np.random.Generator,
    arm: Arm,
    position: Signal,
    gain: np.ndarray,
    noise: Noise,
    rate: int,
    decimals: int,
    recorded: bool,
    highest: float,
) -> Signal:
    """Return a stiffness that the arm can have all along: a constant, or motions of its own kind."""
    needed = least_stiffness(arm, position.derivatives(position.series, 5)).max()
    period, depth = len(position.values), rng.uniform(0.1, 0.4) * recorded
    lowest = needed * rng.uniform(1.1, 1.6)
    motion = str(rng.choice(["slow sines", "rest to rest, pauses", "random"]))
    exact = fourier_series(rng, motion, period, rate, min(2.0, highest))
    shape = np.fft.irfft(exact, period)
    mean = lowest / (1 - depth)
    exact *= depth * mean / np.abs(shape).max()
    exact[0] = mean * period
    level = mean * _logarithmic(rng, *LEVELS) if recorded else 0.0
    if not recorded:
        return Signal(np.full(period, mean), exact, gain, np.zeros(len(exact)), 0.0, position.frequencies)
    return _signal(rng, exact, gain, noise._replace(level=level), rate, max(3, decimals - 3))
