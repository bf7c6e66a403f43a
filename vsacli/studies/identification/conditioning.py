"""Conditioning of a recording: its bandwidth, low-pass filters, derivatives, and the noise of its sensors.

Positions pass a low-pass before they are differentiated. What an equation then makes of them, and the
measured torque, pass the same second one, of half the bandwidth: what the first changes, at its flank, the
second does not let through, so that no column of an equation is biased against another.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray

ORDER = 6
"""Order of the Butterworth filters, which run forwards and backwards: the flank is that of twice the
order."""

WIDER = 2.0
"""Bandwidth of the filter of positions over that of equations: at 2, each changes what the other lets through
by 2.4e-4."""

RINGING = 3.0
"""Ends of a record that are left out, in periods of the bandwidth: of sums of sines cut off in full motion,
the acceleration was off by 7e-5 of its rms there at most, and by 2e-3 a period earlier."""

SMOOTHNESS = 5
"""Degree of the spline by which filtered positions are differentiated."""


class Filter(NamedTuple):
    """The low-pass of all columns of the equations of a record, without lag.

    Attributes:
        bandwidth: at which it halves an amplitude, Hz.
        sections: of second order, as of `scipy.signal.butter`.
        stride: samples to one row of an equation, so that rows come at about twice the bandwidth and their
            noise is nearly white.
        reach: samples after which it has forgotten nearly all.
    """

    bandwidth: float
    sections: FloatArray
    stride: int
    reach: int

    @classmethod
    def low_pass(cls, bandwidth: float, rate: float) -> Filter:
        """Return a low-pass with a bandwidth, for recordings with this many samples a second; both Hz."""
        from scipy.signal import butter

        sections = butter(ORDER, bandwidth, fs=rate, output="sos")
        return cls(bandwidth, sections, max(1, int(rate / (2 * bandwidth))), int(RINGING * rate / bandwidth))

    def smoothed(self, columns: FloatArray, ends: Literal["even", "odd"] = "even") -> FloatArray:
        """Return the same columns, (samples, ...), filtered; those with NaN are NaN.

        Args:
            columns: as they are; beyond either end they are taken to go on.
            ends: how: "even", as in a mirror, which keeps the noise of the last sample as small as that of
                others, or "odd", as turned about the last sample, which keeps the slope.
        """
        from scipy.signal import sosfiltfilt

        beyond = min(self.reach, len(columns) - 1)
        return np.asarray(sosfiltfilt(self.sections, columns, axis=0, padtype=ends, padlen=beyond))

    def applied(self, columns: FloatArray) -> FloatArray:
        """Rows of equations, (rows, ...), from columns at the rate of the record, (samples, ...).

        At its ends the filter does the same to all columns, whatever that is.
        """
        return self.smoothed(columns)[:: self.stride]


class Signals(NamedTuple):
    """One record on a uniform grid, SI units, joint side of the gears.

    Attributes:
        time: (samples,), s; the ends where the filter of the positions rings are left out.
        q, dq, ddq: motion of the joints, (samples, joints).
        theta, dtheta, ddtheta: motion of the motors, (samples, joints, 2); NaN where there is no motor, or
            nothing was recorded.
        tau_motor: torques as measured, unfiltered, (samples, joints, 2), NaN there, too.
        rate: samples a second.
        filter: which every column of an equation passes, the measured torque as well.
        noise: standard deviation of the noise of q and both theta before filtering, as far as it is white,
            (joints, 3), NaN there, too; None if it is not known.
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

    def during(self, samples: slice) -> Signals:
        """Return some consecutive samples of it."""
        over_time = ("time", "q", "dq", "ddq", "theta", "dtheta", "ddtheta", "tau_motor")
        return self._replace(**{name: getattr(self, name)[samples] for name in over_time})


def conditioned(
    time: FloatArray, q: FloatArray, theta: FloatArray, tau_motor: FloatArray, bandwidth: float
) -> Signals:
    """Filter and differentiate.

    Args:
        time: (samples,), s, in equal steps.
        q: (samples, joints).
        theta: (samples, joints, 2), NaN throughout where there are none.
        tau_motor: as above.
        bandwidth: of the equations, Hz, less than a quarter of the rate.
    """
    rate = (len(time) - 1) / float(time[-1] - time[0])
    positions, low_pass = np.concatenate((q[..., None], theta), axis=-1), Filter.low_pass(bandwidth, rate)
    motion = _motion(time, positions, low_pass, rate)
    inside = slice(low_pass.reach, len(time) - low_pass.reach)
    noise = np.sqrt(
        np.mean((positions[inside] - motion[0]) ** 2, axis=0) / (1 - 2 * WIDER * bandwidth / rate)
    )
    return Signals(
        time=time[inside],
        **_by_name(motion),
        tau_motor=tau_motor[inside],
        rate=rate,
        filter=low_pass,
        noise=noise,
    )


def _by_name(motion: Sequence[FloatArray]) -> dict[str, FloatArray]:
    """Positions, velocities and accelerations (samples, joints, 3) as fields of `Signals`."""
    named: dict[str, FloatArray] = {}
    for derivative, each in zip(("", "d", "dd"), motion, strict=True):
        named |= {f"{derivative}q": each[..., 0], f"{derivative}theta": each[..., 1:]}
    return named


def disturbed(signals: Signals) -> Signals:
    """Return the recording with its noise of positions added once more, equal in every call."""
    assert signals.noise is not None, "of a record"
    samples = len(signals.time) + 2 * signals.filter.reach
    drawn = np.random.default_rng(0).normal(size=(samples, *signals.noise.shape)) * signals.noise
    noise = _motion(np.arange(samples) / signals.rate, drawn, signals.filter, signals.rate)
    changes = _by_name(noise).items()
    return signals._replace(**{name: getattr(signals, name) + change for name, change in changes})


def _motion(time: FloatArray, positions: FloatArray, low_pass: Filter, rate: float) -> tuple[FloatArray, ...]:
    """Positions and their first two derivatives, filtered, without the ends where that rings."""
    smooth = Filter.low_pass(WIDER * low_pass.bandwidth, rate).smoothed(positions, ends="odd")
    inside = slice(low_pass.reach, len(time) - low_pass.reach)
    return tuple(each[inside] for each in (smooth, *_derivatives(time, smooth)))


def _derivatives(time: FloatArray, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First and second, of columns (samples, ...) without NaN or wholly NaN."""
    from scipy.interpolate import make_interp_spline

    there = np.isfinite(positions).all(axis=0)
    found = np.full((2, *positions.shape), np.nan)
    spline = make_interp_spline(time, positions[:, there], k=SMOOTHNESS)
    for order, derivative in enumerate(found, 1):
        derivative[:, there] = spline(time, order)
    return found[0], found[1]


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
    """Return a bandwidth for the equations of a record, Hz.

    Args:
        time: (samples,), s, in equal steps.
        q: positions of joints, (samples, joints); NaN in columns that were not recorded.
        theta: of motors, (samples, joints, 2), as above.
    """
    lowest, highest = bounds(time)
    positions = np.concatenate((q[..., None], theta), axis=-1).reshape(len(time), -1)
    recorded = positions[:, np.isfinite(positions).all(axis=0)]
    edges, ends = zip(*(_motion_and_noise_ends(time, column) for column in recorded.T), strict=True)
    return float(np.clip(min(ROOM * max(edges), min(ends), FASTEST), lowest, highest))


def bounds(time: FloatArray) -> tuple[float, float]:
    """Between which bandwidths of a record lie, Hz."""
    duration = float(time[-1] - time[0])
    return SLOWEST_SPANS / duration, (len(time) - 1) / duration / SAMPLES


def _motion_and_noise_ends(time: FloatArray, column: FloatArray) -> tuple[float, float]:
    """Return the highest frequency that can be told from noise, and that up to which accelerations can."""
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


QUIET_FROM = 2.0
"""Bandwidths from which on a record holds hardly any motion."""


def torque_noise(signals: Signals) -> FloatArray:
    """Root mean square of what of the noise of each motor's torque passes the filter, (joints, 2).

    As if it were white: that of drives which filter their torque is larger. NaN where it cannot be told.
    """
    from scipy.signal import sosfreqz

    count = len(signals.time)
    if signals.rate / 4 < QUIET_FROM * signals.filter.bandwidth:
        return np.full(signals.tau_motor.shape[1:], np.nan)
    power = np.abs(np.fft.rfft(signals.tau_motor * np.hanning(count)[:, None, None], axis=0)) ** 2
    density = white_noise(power) / np.sum(np.hanning(count) ** 2)
    _, gain = sosfreqz(signals.filter.sections, worN=1 << 16)
    passing = float(np.mean(np.abs(gain) ** 4))  # of the power of white noise, forwards and backwards
    return np.asarray(np.sqrt(density * passing))
