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

RINGING = 2.0
"""Ends of a record that are left out, in periods of the bandwidth: of sums of sines cut off in full motion,
the acceleration was off by 0.4 % of its rms there, 3 % at worst, and by a fifth of that half a period on."""

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
    positions = np.concatenate((q[..., None], theta), axis=-1)
    smooth = Filter.low_pass(WIDER * bandwidth, rate).smoothed(positions, ends="odd")
    low_pass = Filter.low_pass(bandwidth, rate)
    inside = slice(low_pass.reach, len(time) - low_pass.reach)
    smooth, rates, accelerations = (each[inside] for each in (smooth, *_derivatives(time, smooth)))
    return Signals(
        time=time[inside],
        q=smooth[..., 0],
        dq=rates[..., 0],
        ddq=accelerations[..., 0],
        theta=smooth[..., 1:],
        dtheta=rates[..., 1:],
        ddtheta=accelerations[..., 1:],
        tau_motor=tau_motor[inside],
        rate=rate,
        filter=low_pass,
    )


def _derivatives(time: FloatArray, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First and second, of columns (samples, ...) without NaN or wholly NaN."""
    from scipy.interpolate import make_interp_spline

    there = np.isfinite(positions).all(axis=0)
    found = np.full((2, *positions.shape), np.nan)
    spline = make_interp_spline(time, positions[:, there], k=SMOOTHNESS)
    for order, derivative in enumerate(found, 1):
        derivative[:, there] = spline(time, order)
    return found[0], found[1]
