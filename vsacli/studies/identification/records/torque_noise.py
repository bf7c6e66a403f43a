"""The noise of measured torques, from where no motion is."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.studies.identification.records.bandwidth import white_noise
from vsacli.studies.identification.records.signals import Filter, Signals

QUIET_FROM = 2.0
"""Bandwidths from which on a record holds hardly any motion."""


def torque_noise(signals: Signals) -> FloatArray:
    """Root mean square of what of the noise of each motor's torque passes the filter, (joints, 2).

    As if it were white: that of drives which filter their torque is larger. NaN where it cannot be told.
    """
    count = len(signals.time)
    if signals.rate / 4 < QUIET_FROM * signals.filter.bandwidth:
        return np.full(signals.tau_motor.shape[1:], np.nan)
    power = np.abs(np.fft.rfft(signals.tau_motor * np.hanning(count)[:, None, None], axis=0)) ** 2
    density = white_noise(power) / np.sum(np.hanning(count) ** 2)
    return np.asarray(np.sqrt(density * _passing(signals.filter)))


def _passing(low_pass: Filter) -> float:
    """Share of the power of white noise that passes forwards and backwards."""
    from scipy.signal import sosfreqz

    _, gain = sosfreqz(low_pass.sections, worN=1 << 16)
    return float(np.mean(np.abs(gain) ** 4))
