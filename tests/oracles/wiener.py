"""The best that smoothing can do on a recording whose filter and noise are known exactly.

It is the Wiener smoother of a random process with the power s f^-2n, which stands for the unfiltered motion:
the limit of penalized splines of order n with ever finer knots. In the Fourier series of the whole period, of
which the recording is half, generalized least squares with the exact covariance of the noise are one
factor per frequency. Only s and n describe the motion, and they are chosen by the truth. A smoother of a
laboratory's file does not have the other half of the period; that matters near the ends only, and these are
left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from oracles.one_joint import motor_torque

if TYPE_CHECKING:
    from samples.random_recordings import Recording, Signal

ORDERS = (4, 6, 8)
"""Of the process, n."""

LEVELS = 28
"""Crossovers of motion and noise that are tried, from 0.5 Hz to 0.45 of the rate."""

LEFT_OUT = 0.1
"""Share of the recording at each end."""


def attainable_error(recording: Recording) -> float:
    """Return the least relative error of tau_motor, root mean square; of the motor where it is larger."""
    q, stiffness = recording.truth
    true = motor_torque(recording.arm, q, stiffness)

    def error(q: np.ndarray, stiffness: np.ndarray | None) -> float:
        return relative_error(motor_torque(recording.arm, q, stiffness), true)

    of_position = _best(recording.position, recording.rate, 5, lambda rows: error(rows, stiffness))
    if not recording.stiffness_recorded:
        return error(of_position, stiffness)
    of_stiffness = _best(recording.stiffness, recording.rate, 3, lambda rows: error(q, rows))
    return error(of_position, of_stiffness)


def relative_error(found: np.ndarray, true: np.ndarray) -> float:
    """Return the root mean square of a difference relative to that of the truth, the largest of all rows."""
    ends = round(LEFT_OUT * true.shape[1])
    difference, expected = (found - true)[:, ends:-ends], true[:, ends:-ends]
    return float(np.max(np.sqrt(np.mean(difference**2, axis=1) / np.mean(expected**2, axis=1))))


def _best(signal: Signal, rate: int, orders: int, error: Callable[[np.ndarray], float]) -> np.ndarray:
    found = (signal.derivatives(series, orders) for series in _smoothed(signal, rate))
    return min(found, key=lambda rows: np.nan_to_num(error(rows), nan=np.inf))


def _smoothed(signal: Signal, rate: int) -> Iterator[np.ndarray]:
    """Yield the Fourier series that belong to each order and level of the process."""
    recorded = np.fft.rfft(signal.values)
    with np.errstate(divide="ignore"):  # filters with zeros
        noise = signal.density + signal.rounding**2 / np.abs(signal.gain) ** 2
    typical = signal.density.mean()
    for order in ORDERS:
        for crossover in np.geomspace(0.5, 0.45 * rate, LEVELS):
            with np.errstate(over="ignore", invalid="ignore"):
                against = noise / typical * (signal.frequencies / crossover) ** (2 * order)
            yield recorded / (1 + np.nan_to_num(against, nan=0.0, posinf=np.inf))
