"""Inverse of a spring law without a closed one, by Halley's method in a shrinking bracket."""

from __future__ import annotations

import numpy as np

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.laws.state import SpringState
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, look_up, repeat, where_needed

MOST_STEPS = 200
"""More than bisection alone needs for all digits of a double."""

LAST_STEP = 2e-6
"""Relative error of the torque from which one more step leaves rounding only: it takes the third power."""

GUESSED = 1e-6
"""Relative error of the torque with which a first guess is content."""

MOST_HALVINGS = 20
"""Of the cells between the nodes of a first guess; next to slack the deflection is a root of the torque."""

TINY = 1e-100
"""Instead of the difference of torques that rounding has made equal, N m."""


def inverse(
    law: SpringLaw, torque: FloatArray, low: FloatArray, high: FloatArray, start: FloatArray
) -> tuple[FloatArray, SpringState]:
    """Deflection at which the law has a torque, between `low` and `high` that enclose it; the spring there.

    The last step is so short that what was known before it tells what the spring is after it.
    """
    with np.errstate(all="ignore"):  # without stiffness at rest, a step leads nowhere
        phi, error, spring = _halley(law, torque, start)
        met = _is_met(torque, error) & (phi >= low) & (phi <= high)
        phi, *values = where_needed(
            ~met,
            lambda *known: _bracketed(law, *known),
            (torque, low, high, start),
            (phi, *spring.after(phi - start)),
        )
        return np.where(torque == 0, 0.0, phi), SpringState(*values)


def _halley(
    law: SpringLaw, torque: FloatArray, phi: FloatArray
) -> tuple[FloatArray, FloatArray, SpringState]:
    """The deflection after a step, and the error of the torque and the spring before it."""
    spring = law.state(phi)
    error = spring.tau - torque
    newton = error / spring.sigma
    bend = newton * spring.zeta / (2 * spring.sigma)
    return phi - newton / np.minimum(np.maximum(1 - bend, 0.5), 2), error, spring


def _is_met(torque: FloatArray, error: FloatArray) -> BoolArray:
    met: BoolArray = np.abs(error) <= LAST_STEP * np.abs(torque)
    return met


def _bracketed(
    law: SpringLaw, torque: FloatArray, low: FloatArray, high: FloatArray, start: FloatArray
) -> Values:
    """The same from a start that is far away: by the same step where it stays in a shrinking bracket."""

    def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
        (phi, low, high, *_), (torque,) = state, constants
        halley, error, spring = _halley(law, torque, phi)
        low, high = np.where(error <= 0, phi, low), np.where(error >= 0, phi, high)
        inside = (halley >= low) & (halley <= high)
        following = np.where(inside, halley, (low + high) / 2)
        met = inside & _is_met(torque, error)
        return (following, low, high, *spring.after(following - phi)), met | ~(low < high)

    low = np.where(np.isfinite(torque), low, np.nan)
    phi, _, _, *spring = repeat(step, (start, low, high, *[start] * 4), (torque,), MOST_STEPS)
    return phi, *spring


def turned_to(torque: FloatArray, phi: FloatArray, spring: SpringState) -> tuple[FloatArray, SpringState]:
    """Of a law that is odd, from the size of its torque to the torque."""
    tau, zeta = np.copysign(spring.tau, torque), np.copysign(spring.zeta, torque)
    return np.copysign(phi, torque), spring._replace(tau=tau, zeta=zeta)


class FirstGuess:
    """Deflections of a law by cubic interpolation over the torque, between nodes that are computed once."""

    def __init__(self, law: SpringLaw, nodes: FloatArray) -> None:
        """Begin with ascending nodes, and halve the cells that are too wide for a cubic."""
        self._interpolate(law, nodes)
        for _ in range(MOST_HALVINGS):
            middle = (nodes[:-1] + nodes[1:]) / 2
            torque = law.torque(middle)
            guessed = law.torque(np.clip(self(torque), nodes[:-1], nodes[1:]))
            wide = np.abs(guessed - torque) > GUESSED * np.abs(torque)
            if not wide.any():
                break
            nodes = np.union1d(nodes, middle[wide])
            self._interpolate(law, nodes)

    def _interpolate(self, law: SpringLaw, nodes: FloatArray) -> None:
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
        start, a, b, c, d = look_up((self._torque, *self._coefficients), cell)
        beyond = torque - start
        return a + beyond * (b + beyond * (c + beyond * d))
