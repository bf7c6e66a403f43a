"""A record after conditioning: motion with its derivatives, torques, and the low-pass of all equations.

Positions pass a low-pass before they are differentiated. What an equation then makes of them, and the
measured torque, pass the same second one, of half the bandwidth: what the first changes, at its flank, the
second does not let through, so that no column of an equation is biased against another.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray

ORDER = 6
"""Of the Butterworth filters, which run forwards and backwards: the flank is that of twice the order."""

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
        """Of a bandwidth, for records with so many samples a second; Hz both."""
        from scipy.signal import butter

        sections = butter(ORDER, bandwidth, fs=rate, output="sos")
        return cls(bandwidth, sections, max(1, int(rate / (2 * bandwidth))), int(RINGING * rate / bandwidth))

    def smoothed(self, columns: FloatArray, ends: Literal["even", "odd"] = "even") -> FloatArray:
        """The same columns, (samples, ...), filtered; those with NaN are NaN.

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
        tau_motor: torques as measured, unfiltered, (samples, joints, 2), NaN likewise.
        rate: samples a second.
        filter: which every column of an equation passes, the measured torque as well.
        noise: standard deviation of the noise of q and both theta before filtering, as far as it is white,
            (joints, 3), NaN likewise; None if it is not known.
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
        """Some consecutive samples of it."""
        over_time = ("time", "q", "dq", "ddq", "theta", "dtheta", "ddtheta", "tau_motor")
        return self._replace(**{name: getattr(self, name)[samples] for name in over_time})


def conditioned(
    time: FloatArray, q: FloatArray, theta: FloatArray, tau_motor: FloatArray, bandwidth: float
) -> Signals:
    """Filter and differentiate.

    Args:
        time: (samples,), s, in equal steps.
        q: (samples, joints).
        theta: (samples, joints, 2), NaN throughout where there is none.
        tau_motor: likewise.
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
        q=motion[0][..., 0],
        dq=motion[1][..., 0],
        ddq=motion[2][..., 0],
        theta=motion[0][..., 1:],
        dtheta=motion[1][..., 1:],
        ddtheta=motion[2][..., 1:],
        tau_motor=tau_motor[inside],
        rate=rate,
        filter=low_pass,
        noise=noise,
    )


def disturbed(signals: Signals) -> Signals:
    """The same with noise of positions once more, as large as that of the record was, the same each time."""
    assert signals.noise is not None, "of a record"
    samples = len(signals.time) + 2 * signals.filter.reach
    drawn = np.random.default_rng(0).normal(size=(samples, *signals.noise.shape)) * signals.noise
    noise = _motion(np.arange(samples) / signals.rate, drawn, signals.filter, signals.rate)
    return signals._replace(
        q=signals.q + noise[0][..., 0],
        dq=signals.dq + noise[1][..., 0],
        ddq=signals.ddq + noise[2][..., 0],
        theta=signals.theta + noise[0][..., 1:],
        dtheta=signals.dtheta + noise[1][..., 1:],
        ddtheta=signals.ddtheta + noise[2][..., 1:],
    )


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
