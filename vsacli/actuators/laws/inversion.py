"""Numerical inverse of a spring law: Halley's method within a shrinking bracket, from a cubic guess."""

from __future__ import annotations

import numpy as np

from vsacli.actuators.laws.law import SpringLaw, SpringState, spring_state
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, look_up, repeat, where_needed


def evaluate_hermite_cubic(
    x: FloatArray, low: FloatArray, high: FloatArray, low_slope: FloatArray, high_slope: FloatArray
) -> FloatArray:
    """Return the cubic over x from 0 to 1 with values and slopes at both ends; arrays of one shape."""
    rise = high - low
    return low + x * (
        low_slope + x * (3 * rise - 2 * low_slope - high_slope + x * (low_slope + high_slope - 2 * rise))
    )


def round_to_single(values: FloatArray) -> FloatArray:
    """Return values rounded to single precision, enough for a guess; unchanged beyond its range."""
    with np.errstate(all="ignore"):
        rounded = values.astype(np.float32).astype(float)
    return np.where(np.isfinite(rounded) & ((rounded == 0) == (values == 0)), rounded, values)


MAX_HALLEY_STEPS = 200
"""Largest number of steps, more than bisection alone needs for all digits of a double."""

HALLEY_RTOL = 2e-6
"""Relative error of the torque from which one more step converges to rounding: it takes the third power."""

GUESS_RTOL = 1e-6
"""Largest relative error of the torque in a first guess."""

MAX_HALVINGS = 20
"""Largest number of halvings of the cells of a first guess. Next to slack the deflection is a root of the
torque, which no cubic approximates."""


def deflection_at_torque(
    law: SpringLaw, torque: FloatArray, low: FloatArray, high: FloatArray, start: FloatArray
) -> tuple[FloatArray, SpringState]:
    """Return the deflection at which a law has a torque, and the state of the spring there; (samples,).

    The last step is so short that the state before it gives the state after it.

    Args:
        law: Spring.
        torque: Torque of the spring, N m (N).
        low: Lower bound of the deflection, rad (m).
        high: Upper bound of the deflection.
        start: First guess; if it is close, one step suffices, without a loop.
    """
    with np.errstate(all="ignore"):  # division by zero without stiffness at rest
        phi, error, state = _halley_step(law, torque, start)
        converged = _converges(torque, error) & (phi >= low) & (phi <= high)
        phi, *values = where_needed(
            ~converged,
            lambda *unsolved: _halley_in_bracket(law, *unsolved),
            (torque, low, high, start),
            (phi, *state.after(phi - start)),
        )
        return np.where(torque == 0, 0.0, phi), SpringState(*values)


def _halley_step(
    law: SpringLaw, torque: FloatArray, phi: FloatArray
) -> tuple[FloatArray, FloatArray, SpringState]:
    """Return the deflection after a step; also the error of the torque and the spring's state before it."""
    # Halley's correction of the Newton step is kept between one half and two.
    state = spring_state(law, phi)
    error = state.tau - torque
    newton = error / state.sigma
    correction = newton * state.zeta / (2 * state.sigma)
    return phi - newton / np.minimum(np.maximum(1 - correction, 0.5), 2), error, state


def _converges(torque: FloatArray, error: FloatArray) -> BoolArray:
    """Return whether one more step converges to rounding, from the error of the torque."""
    return np.abs(error) <= HALLEY_RTOL * np.abs(torque)


def _halley_in_bracket(
    law: SpringLaw, torque: FloatArray, low: FloatArray, high: FloatArray, start: FloatArray
) -> Values:
    """Invert a law from a distant start: Halley steps within the bracket, else bisection."""

    def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
        (phi, low, high, *_), (torque,) = state, constants
        halley, error, spring = _halley_step(law, torque, phi)
        low, high = np.where(error <= 0, phi, low), np.where(error >= 0, phi, high)
        is_inside, middle = (halley >= low) & (halley <= high), (low + high) / 2
        next_phi = np.where(is_inside, halley, middle)
        converged = is_inside & _converges(torque, error)
        is_exhausted = (next_phi == phi) | ~((low < middle) & (middle < high))  # no double lies between
        return (next_phi, low, high, *spring.after(next_phi - phi)), converged | is_exhausted

    low = np.where(np.isfinite(torque), low, np.nan)
    phi, _, _, *spring = repeat(step, (start, low, high, *[start] * 4), (torque,), MAX_HALLEY_STEPS)
    return phi, *spring


def with_sign_of(torque: FloatArray, phi: FloatArray, state: SpringState) -> tuple[FloatArray, SpringState]:
    """Return deflection and state of an odd law at a torque, from those at its absolute value."""
    tau, zeta = np.copysign(state.tau, torque), np.copysign(state.zeta, torque)
    return np.copysign(phi, torque), state._replace(tau=tau, zeta=zeta)


class FirstGuess:
    """Deflection over the torque by Hermite cubics, between nodes of a law that are computed once."""

    def __init__(self, law: SpringLaw, nodes: FloatArray) -> None:
        """Begin with ascending nodes, and halve cells until cubics are accurate."""
        self._set_nodes(law, nodes)
        for _ in range(MAX_HALVINGS):
            middle = (nodes[:-1] + nodes[1:]) / 2
            torque = law.torque(middle)
            guessed_torque = law.torque(np.clip(self(torque), nodes[:-1], nodes[1:]))
            too_wide = np.abs(guessed_torque - torque) > GUESS_RTOL * np.abs(torque)
            if not too_wide.any():
                break
            nodes = np.union1d(nodes, middle[too_wide])
            self._set_nodes(law, nodes)

    def _set_nodes(self, law: SpringLaw, nodes: FloatArray) -> None:
        torque, stiffness = law.derivatives(nodes, 1)
        compliance = 1 / np.where(stiffness == 0, np.inf, stiffness)
        self._nodes = torque, nodes, round_to_single(compliance)

    def __call__(self, torque: FloatArray) -> FloatArray:
        """Return the deflection at torques between those of the nodes."""
        cell = np.searchsorted(self._nodes[0][1:-1], torque, side="right")
        low_torque, low_phi, low_compliance = look_up(self._nodes, cell)
        high_torque, high_phi, high_compliance = look_up(self._nodes, cell + 1)
        width = high_torque - low_torque
        return evaluate_hermite_cubic(
            (torque - low_torque) / width, low_phi, high_phi, low_compliance * width, high_compliance * width
        )
