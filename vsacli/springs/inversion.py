"""Inverse of a spring law without a closed one, by Newton's method in a shrinking bracket."""

from __future__ import annotations

import numpy as np

from vsacli.arrays import BoolArray, FloatArray
from vsacli.loops import Values, look_up, repeat
from vsacli.springs.law import SpringLaw

MOST_STEPS = 200
"""More than bisection alone needs for all digits of a double."""

LAST_STEP = 1e-8
"""Relative error of the torque from which one more Newton step leaves rounding only: it squares the error."""

TINY = 1e-100
"""Instead of the difference of torques that rounding has made equal, N m."""


def inverse(
    law: SpringLaw, torque: FloatArray, low: FloatArray, high: FloatArray, start: FloatArray
) -> FloatArray:
    """Deflection at which the law has a torque, between `low` and `high` that enclose it."""

    def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
        (phi, low, high), (wanted,) = state, constants
        torque, stiffness = law.derivatives(phi, 1)
        error = torque - wanted
        low, high = np.where(error <= 0, phi, low), np.where(error >= 0, phi, high)
        with np.errstate(divide="ignore", invalid="ignore"):  # no stiffness at rest: halve the bracket
            newton = phi - error / stiffness
        inside = (newton >= low) & (newton <= high)
        met = inside & (np.abs(error) <= LAST_STEP * np.abs(wanted))
        return (np.where(inside, newton, (low + high) / 2), low, high), met | ~(low < high)

    phi, _, _ = repeat(step, (start, low, high), (torque,), MOST_STEPS)
    return np.where(torque == 0, 0.0, np.where(np.isfinite(torque), phi, np.nan))


class FirstGuess:
    """Deflections of a law by cubic interpolation over the torque, between nodes that are computed once."""

    def __init__(self, law: SpringLaw, nodes: FloatArray) -> None:
        torque, stiffness = law.derivatives(nodes, 1)
        compliance = 1 / np.where(stiffness == 0, np.inf, stiffness)
        width, rise = np.maximum(np.diff(torque), TINY), np.diff(nodes)
        mean, first, last = rise / width, compliance[:-1], compliance[1:]
        bend, twist = (3 * mean - 2 * first - last) / width, (first + last - 2 * mean) / width**2
        self._torque = torque[:-1]
        self._coefficients = nodes[:-1], first, bend, twist

    def __call__(self, torque: FloatArray) -> FloatArray:
        """The deflection under torques within those of the nodes."""
        cell = np.searchsorted(self._torque[1:], torque, side="right")
        beyond = torque - look_up(self._torque, cell)
        a, b, c, d = (look_up(row, cell) for row in self._coefficients)
        return a + beyond * (b + beyond * (c + beyond * d))
