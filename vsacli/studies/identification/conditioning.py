"""Conditioning of a recording: its bandwidth, low-pass filters, derivatives, and the noise of its sensors.

Positions pass a low-pass filter before they are differentiated. All columns of an equation, which are
functions of them, and the measured torque then pass a common second filter of half the bandwidth. It blocks
the frequencies that the first one attenuates, so that no column of an equation is biased against another.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray

FILTER_ORDER = 6
"""Order of the Butterworth filters; run forwards and backwards, they are as steep as twice the order."""

POSITION_BANDWIDTH_RATIO = 2.0
"""Ratio of the bandwidth for positions to that for equations: at 2, each filter changes the pass band of the
other by 2.4e-4."""

RINGING_PERIODS = 3.0
"""Discarded part at each end of a recording, in periods of the bandwidth: for sums of sines that are cut off
in motion, the acceleration error beyond it was at most 7e-5 of the rms, and 2e-3 one period earlier."""

SPLINE_DEGREE = 5
"""Degree of the spline that differentiates filtered positions."""


class Filter(NamedTuple):
    """A zero-phase low-pass filter for all columns of the equations of a recording.

    Attributes:
        bandwidth: frequency at which the amplitude is halved, Hz.
        sections: second-order sections from `scipy.signal.butter`.
        stride: samples per row of an equation, so that the rate of rows is about twice the bandwidth and
            their noise is nearly white.
        reach: samples after which the impulse response has nearly vanished.
    """

    bandwidth: float
    sections: FloatArray
    stride: int
    reach: int

    @classmethod
    def low_pass(cls, bandwidth: float, rate: float) -> Filter:
        """Return a filter with a bandwidth in Hz for recordings with a sample rate in Hz."""
        sections = scipy.signal.butter(FILTER_ORDER, bandwidth, fs=rate, output="sos")
        return cls(
            bandwidth, sections, max(1, int(rate / (2 * bandwidth))), int(RINGING_PERIODS * rate / bandwidth)
        )

    def smoothed(self, columns: FloatArray, ends: Literal["even", "odd"] = "even") -> FloatArray:
        """Return columns filtered, (samples, ...); a column with NaN is all NaN.

        Args:
            columns: columns to filter, (samples, ...).
            ends: continuation beyond both ends: "even" mirrors, which keeps the noise of the last sample as
                small as that of others; "odd" rotates about the last sample, which keeps the slope.
        """
        padding = min(self.reach, len(columns) - 1)
        return np.asarray(
            scipy.signal.sosfiltfilt(self.sections, columns, axis=0, padtype=ends, padlen=padding)
        )

    def applied(self, columns: FloatArray) -> FloatArray:
        """Return rows of equations, (rows, ...), from columns at the rate of the recording, (samples, ...).

        The effects of the ends are the same for all columns, so the equations hold there as well.
        """
        return self.smoothed(columns)[:: self.stride]


class ConditionedRecording(NamedTuple):
    """A conditioned recording on a uniform grid, in SI units on the joint side of the gears.

    Attributes:
        time: times, (samples,) in s, without the ends where the filter of the positions rings.
        q, dq, ddq: motion of the joints, (samples, joints).
        theta, dtheta, ddtheta: motion of the motors, (samples, joints, 2); NaN where there is no motor, or
            nothing was recorded.
        tau_motor: measured torques, unfiltered, (samples, joints, 2), with NaN in the same places.
        rate: sample rate, Hz.
        filter: filter for every column of an equation, including the measured torque.
        noise: standard deviation of the white noise of q and both theta before filtering, (joints, 3), with
            NaN in the same places; None if unknown.
    """

    time: FloatArray
    q: FloatArray
    dq: FloatArray
    ddq: FloatArray
    theta: FloatArray
    dtheta: FloatArray
    ddtheta: FloatArray
    tau_motor: FloatArray
    rate: float
    filter: Filter
    noise: FloatArray | None = None

    def during(self, samples: slice) -> ConditionedRecording:
        """Return consecutive samples of the recording."""
        over_time = ("time", "q", "dq", "ddq", "theta", "dtheta", "ddtheta", "tau_motor")
        return self._replace(**{name: getattr(self, name)[samples] for name in over_time})


def conditioned(
    time: FloatArray, q: FloatArray, theta: FloatArray, tau_motor: FloatArray, bandwidth: float
) -> ConditionedRecording:
    """Filter and differentiate a recording.

    Args:
        time: evenly spaced times, (samples,) in s.
        q: joint positions, (samples, joints).
        theta: motor positions, (samples, joints, 2); columns without data are NaN.
        tau_motor: motor torques, (samples, joints, 2); columns without data are NaN.
        bandwidth: bandwidth of the equations, Hz, less than a quarter of the sample rate.
    """
    rate = (len(time) - 1) / float(time[-1] - time[0])
    positions, low_pass = np.concatenate((q[..., None], theta), axis=-1), Filter.low_pass(bandwidth, rate)
    motion = _filtered_motion(time, positions, low_pass, rate)
    inner = slice(low_pass.reach, len(time) - low_pass.reach)
    noise = np.sqrt(
        np.mean((positions[inner] - motion[0]) ** 2, axis=0)
        / (1 - 2 * POSITION_BANDWIDTH_RATIO * bandwidth / rate)
    )
    return ConditionedRecording(
        time=time[inner],
        **_signals_by_name(motion),
        tau_motor=tau_motor[inner],
        rate=rate,
        filter=low_pass,
        noise=noise,
    )


def _signals_by_name(motion: Sequence[FloatArray]) -> dict[str, FloatArray]:
    """Return positions, velocities and accelerations, (samples, joints, 3), by their fields."""
    signals_by_name: dict[str, FloatArray] = {}
    for derivative, each in zip(("", "d", "dd"), motion, strict=True):
        signals_by_name |= {f"{derivative}q": each[..., 0], f"{derivative}theta": each[..., 1:]}
    return signals_by_name


def disturbed(recording: ConditionedRecording) -> ConditionedRecording:
    """Return the recording with position noise added once more; every call adds the same noise."""
    assert recording.noise is not None, "of a record"
    sample_count = len(recording.time) + 2 * recording.filter.reach
    position_noise = (
        np.random.default_rng(0).normal(size=(sample_count, *recording.noise.shape)) * recording.noise
    )
    noise = _filtered_motion(
        np.arange(sample_count) / recording.rate, position_noise, recording.filter, recording.rate
    )
    noise_by_name = _signals_by_name(noise).items()
    return recording._replace(**{name: getattr(recording, name) + change for name, change in noise_by_name})


def _filtered_motion(
    time: FloatArray, positions: FloatArray, low_pass: Filter, rate: float
) -> tuple[FloatArray, ...]:
    """Return filtered positions and their first two derivatives, without the ends where filters ring."""
    filtered = Filter.low_pass(POSITION_BANDWIDTH_RATIO * low_pass.bandwidth, rate).smoothed(
        positions, ends="odd"
    )
    inner = slice(low_pass.reach, len(time) - low_pass.reach)
    return tuple(each[inner] for each in (filtered, *spline_derivatives(time, filtered)))


def spline_derivatives(time: FloatArray, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the first two derivatives of columns, (samples, ...); those of a column with NaN are all NaN."""
    is_recorded = np.isfinite(positions).all(axis=0)
    derivatives = np.full((2, *positions.shape), np.nan)
    if is_recorded.any():
        spline = scipy.interpolate.make_interp_spline(time, positions[:, is_recorded], k=SPLINE_DEGREE)
        derivatives[:, :, is_recorded] = spline(time, 1), spline(time, 2)
    return derivatives[0], derivatives[1]


ABOVE_NOISE = 30.0
"""Ratio of a spectral line's power to the noise at high frequencies above which it is motion; none of 1e6
lines of white noise reaches it."""

MOTION_BANDWIDTH_RATIO = 1.5
"""Ratio of the equations' bandwidth to the highest frequency of the motion, which is attenuated by 0.8 %. On
the paper's arm, residuals were noise for ratios from 1 to beyond 10; inertias improve a little up to 4."""

MAX_BANDWIDTH = 20.0
"""Largest bandwidth, Hz: joints move no faster, and the filters then suppress mains hum."""

MAX_NOISE_SHARE = 5e-5
"""Largest ratio of noise power to signal power in the filtered accelerations: the share by which inertias
come out too small."""

MIN_PERIODS = 12.0
"""Smallest number of periods of the bandwidth in a recording: filters discard three at either end."""

MIN_SAMPLES_PER_PERIOD = 8.0
"""Smallest number of samples per period of the bandwidth."""


def bandwidth_of(time: FloatArray, q: FloatArray, theta: FloatArray) -> float:
    """Return a bandwidth for the equations of a recording, Hz.

    Args:
        time: evenly spaced times, (samples,) in s.
        q: joint positions, (samples, joints); NaN in columns that were not recorded.
        theta: motor positions, (samples, joints, 2); NaN in columns that were not recorded.
    """
    min_bandwidth, max_bandwidth = bandwidth_bounds(time)
    positions = np.concatenate((q[..., None], theta), axis=-1).reshape(len(time), -1)
    recorded = positions[:, np.isfinite(positions).all(axis=0)]
    motion_frequencies, noise_frequencies = zip(
        *(_motion_and_noise_frequencies(time, column) for column in recorded.T), strict=True
    )
    return float(
        np.clip(
            min(MOTION_BANDWIDTH_RATIO * max(motion_frequencies), min(noise_frequencies), MAX_BANDWIDTH),
            min_bandwidth,
            max_bandwidth,
        )
    )


def bandwidth_bounds(time: FloatArray) -> tuple[float, float]:
    """Return the smallest and the largest possible bandwidth of a recording, Hz."""
    duration = float(time[-1] - time[0])
    return MIN_PERIODS / duration, (len(time) - 1) / duration / MIN_SAMPLES_PER_PERIOD


def _motion_and_noise_frequencies(time: FloatArray, column: FloatArray) -> tuple[float, float]:
    """Return the highest frequency of the motion above the noise, and that up to which accelerations are."""
    window = np.hanning(len(time))
    power = np.abs(np.fft.rfft(window * (column - np.mean(column)))) ** 2
    frequency = np.fft.rfftfreq(len(time), float(time[1] - time[0]))
    noise = white_noise(power)
    motion_power = np.where((power > ABOVE_NOISE * noise) & (frequency <= MAX_BANDWIDTH), power, 0.0)
    if not motion_power.any():
        return 0.0, np.inf
    below_noise = np.cumsum(noise * frequency**4) > MAX_NOISE_SHARE * np.sum(motion_power * frequency**4)
    noise_frequency = frequency[np.argmax(below_noise)] if below_noise.any() else np.inf
    return float(frequency[np.flatnonzero(motion_power)[-1]]), float(noise_frequency)


def white_noise(power: FloatArray) -> FloatArray:
    """Return the mean power of a line of white noise, from the upper half of a spectrum, (lines, ...)."""
    # powers of noise are exponentially distributed, so that their median is ln 2 of their mean
    return np.asarray(np.median(power[len(power) // 2 :], axis=0) / np.log(2))


QUIET_FREQUENCY_RATIO = 2.0
"""Multiple of the bandwidth above which a recording has hardly any motion."""


def torque_noise(recording: ConditionedRecording) -> FloatArray:
    """Return the rms noise of each motor's torque after the filter, (joints, 2); NaN if unidentifiable.

    The noise is assumed white; that of drives which filter their torque is larger.
    """
    sample_count = len(recording.time)
    if recording.rate / 4 < QUIET_FREQUENCY_RATIO * recording.filter.bandwidth:
        return np.full(recording.tau_motor.shape[1:], np.nan)
    power = np.abs(np.fft.rfft(recording.tau_motor * np.hanning(sample_count)[:, None, None], axis=0)) ** 2
    density = white_noise(power) / np.sum(np.hanning(sample_count) ** 2)
    _, gain = scipy.signal.sosfreqz(recording.filter.sections, worN=1 << 16)
    passed_share = float(np.mean(np.abs(gain) ** 4))  # of the power of white noise, forwards and backwards
    return np.asarray(np.sqrt(density * passed_share))
