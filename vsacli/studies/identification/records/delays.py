"""By how much the torques of a record are later than its positions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.studies.identification.estimation.least_squares import least_squares
from vsacli.studies.identification.estimation.solution import Solution
from vsacli.studies.identification.records.signals import Signals

CERTAIN = 4.0
"""Standard errors from which on a delay is taken out; at 2, each twentieth record without any would be."""

WORTH_IT = 0.05
"""Samples from which on it is worth it."""


class Delay(NamedTuple):
    """Of the torques of a record behind its positions.

    Attributes:
        seconds: negative if they are ahead; NaN if it cannot be told.
        standard_error: of that.
    """

    seconds: float
    standard_error: float

    def matters(self, rate: float) -> bool:
        """Whether it is to be taken out of a record with so many samples a second."""
        size = abs(self.seconds)
        return size > CERTAIN * self.standard_error and size * rate > WORTH_IT


def delay(found: Sequence[Solution], signals: Signals) -> Delay:
    """The one with which the equations of all motors hold best.

    Torques that are late by d are tau(t - d) = tau(t) - d tau'(t): a further unknown of each system.
    """
    rates = np.gradient(signals.tau_motor, 1 / signals.rate, axis=0)
    beside = signals._replace(tau_motor=rates, noise=None)
    told = [each for system in found for each in _of_system(system, signals._replace(noise=None), beside)]
    values, errors = np.array([each for each in told if np.isfinite(each).all()]).reshape(-1, 2).T
    if not len(values):
        return Delay(np.nan, np.nan)
    weights = 1 / errors**2
    return Delay(float(weights @ values / weights.sum()), float(weights.sum() ** -0.5))


def _of_system(found: Solution, signals: Signals, rates: Signals) -> Iterator[tuple[float, float]]:
    """The delay with its standard error, unless nothing of the system was recorded."""
    equations, of_rates = found.equations(signals), found.equations(rates)
    if len(equations.measured):
        of_positions = found.equations(signals._replace(tau_motor=0 * rates.tau_motor))
        slopes = np.column_stack((equations.slopes, of_positions.measured - of_rates.measured))
        fit = least_squares([equations._replace(slopes=slopes)], np.append(found.predicting, 0.0))
        yield float(fit.values[-1]), float(fit.standard_errors[-1])


def without_delay(signals: Signals, late: float) -> Signals:
    """The same with torques that are earlier by so many seconds."""
    from scipy.interpolate import make_interp_spline

    torques = signals.tau_motor.copy()
    there = np.isfinite(torques).all(axis=0)
    shifted: FloatArray = make_interp_spline(signals.time, torques[:, there], k=3)(signals.time + late)
    torques[:, there] = shifted
    return signals._replace(tau_motor=torques)
