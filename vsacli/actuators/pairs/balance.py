"""Two springs that share an elastic torque: states over the preload torque, and steps to the root of (14).

A step of (14) is split in two: a shift of both sides by the same amount restores the torque, and a spread of
phi_1 - phi_2 along the curve of equal tau_e attains the stiffness, which is a parabola over the spread.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import SpringLaw, SpringState, spring_state
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, subroutine

Sides = tuple[FloatArray, FloatArray]
"""A quantity of sides 1 and 2, each a motor with its spring."""


class PairState(NamedTuple):
    """Deflections of both sides and the states of their springs there; arrays of one shape."""

    phi_1: FloatArray
    phi_2: FloatArray
    one: SpringState
    two: SpringState

    @classmethod
    def of(cls, values: Values) -> PairState:
        """Return the state from its `values`."""
        phi_1, phi_2, *spring_values = values
        count = len(SpringState._fields)
        return cls(phi_1, phi_2, SpringState(*spring_values[:count]), SpringState(*spring_values[count:]))

    @property
    def values(self) -> Values:
        """All arrays as one tuple, the form that `repeat` and `where_needed` pass on."""
        return self.phi_1, self.phi_2, *self.one, *self.two

    @property
    def torque(self) -> FloatArray:
        """Elastic torque of the joint, tau_1 + tau_2."""
        return self.one.tau + self.two.tau

    @property
    def stiffness(self) -> FloatArray:
        """Joint stiffness, sigma_1 + sigma_2."""
        return self.one.sigma + self.two.sigma

    @property
    def rho(self) -> Sides:
        """Relative hardening rho = zeta/sigma of each spring."""
        return self.one.zeta / self.one.sigma, self.two.zeta / self.two.sigma

    def regularized(self) -> PairState:
        """Return the state with both stiffnesses set to 1 where both springs are slack, to avoid 0/0."""
        is_slack = self.stiffness == 0
        one, two = (
            spring._replace(sigma=np.where(is_slack, 1.0, spring.sigma)) for spring in (self.one, self.two)
        )
        return self._replace(one=one, two=two)

    def linearization_error(self, step_1: FloatArray, step_2: FloatArray) -> FloatArray:
        """Return the elastic torque after short steps minus its linear prediction, to third order."""
        return self.one.linearization_error(step_1) + self.two.linearization_error(step_2)

    def after(self, step_1: FloatArray, step_2: FloatArray) -> PairState:
        """Return the state after short steps of the deflections, see `SpringState.after`."""
        return PairState(
            self.phi_1 + step_1, self.phi_2 + step_2, self.one.after(step_1), self.two.after(step_2)
        )


def spring_under_torque(law: SpringLaw, torque: FloatArray) -> tuple[FloatArray, SpringState]:
    """Return deflection and state of a spring under a torque, as a subroutine of compiled code."""

    def deflection_and_state(torque: FloatArray) -> Values:
        phi, state = law.deflection_and_state(torque)
        return phi, *state

    phi, *state = subroutine(deflection_and_state, (torque,))
    return phi, SpringState(*state)


@dataclass(frozen=True)
class Balance:
    """Two springs with the preload torque t between them: tau_1 = tau_e/2 + t and tau_2 = tau_e/2 - t.

    The joint stiffness G = sigma_1 + sigma_2 has the slope dG/dt = rho_1 - rho_2 with the relative hardening
    rho_k = zeta_k/sigma_k, and det A = -sigma_1 sigma_2 dG/dt. Arrays of any one shape.
    """

    first: SpringLaw
    second: SpringLaw

    @cached_property
    def domain_ends(self) -> tuple[tuple[SpringState, ...], ...]:
        """State of each spring at the two ends of its domain; scalars, undefined if an end is infinite."""
        with np.errstate(all="ignore"):
            return tuple(
                tuple(law.state(np.array(phi)) for phi in law.domain) for law in (self.first, self.second)
            )

    def preload_range(self, tau_e: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the smallest and the largest t for which both laws hold; smallest > largest if none is."""
        (low_1, high_1), (low_2, high_2) = self.first.torque_range, self.second.torque_range
        return (
            np.maximum(low_1 - tau_e / 2, tau_e / 2 - high_2),
            np.minimum(high_1 - tau_e / 2, tau_e / 2 - low_2),
        )

    def deflections_at(self, tau_e: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return phi_1 and phi_2 at a preload torque t."""
        return self.deflections(tau_e / 2 + t, tau_e / 2 - t)

    def deflections(self, tau_1: FloatArray, tau_2: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return phi_1 and phi_2 at the torques of the two springs."""
        state = self.state_under(tau_1, tau_2)
        return state.phi_1, state.phi_2

    def state_under(self, tau_1: FloatArray, tau_2: FloatArray) -> PairState:
        """Return the state of both springs at their torques."""
        (phi_1, one), (phi_2, two) = (
            spring_under_torque(self.first, tau_1),
            spring_under_torque(self.second, tau_2),
        )
        return PairState(phi_1, phi_2, one, two)

    def state(self, phi_1: FloatArray, phi_2: FloatArray) -> PairState:
        """Return the state of both springs at their deflections."""
        return PairState(phi_1, phi_2, spring_state(self.first, phi_1), spring_state(self.second, phi_2))

    def stiffness_slope(self, phi_1: FloatArray, phi_2: FloatArray) -> FloatArray:
        """Return dG/dt at deflections."""
        return self.first.hardening(phi_1) - self.second.hardening(phi_2)

    def is_slack(self, tau_e: FloatArray, t: FloatArray) -> BoolArray:
        """Return whether a side that only pulls carries no torque."""
        if not (self.first.pulls_only or self.second.pulls_only):
            return np.zeros_like(tau_e, dtype=bool)
        slack: BoolArray = (self.first.pulls_only & (tau_e / 2 + t == 0)) | (
            self.second.pulls_only & (tau_e / 2 - t == 0)
        )
        return slack


MAX_CORRECTION_SHARE = 0.25
"""Largest correction of a step for the bend of the curve of equal tau_e, as a share of the spread.

Found by trial with pairs of every law: between 0.1 and 0.5 the number of steps is about the same; with larger
values more samples end in bracketing."""

QUARTIC_COEFFICIENT, MAX_SQUARED_ARGUMENT = 0.025, 3.0
"""Coefficient and bound of the quartic term in the first guess, for springs that stiffen faster than cosh.

Found by trial with pairs of every law: without it, more steps are needed, and more samples end in
bracketing."""

MIN_SCALE_SHARE = 1e-4
"""Smallest scale of the stiffness in the first guess, as a share of the demand."""


class StiffnessParabola(NamedTuple):
    """Parabola of the stiffness along the curve of equal tau_e, over the spread phi_1 - phi_2; (samples,).

    Attributes:
        stiffness: Stiffness at the point of contact.
        shift_slope: Derivative of the stiffness by a shift of both sides, relative to the stiffness.
        share_1: Share of the spread by which side 1 moves up.
        share_2: Share of the spread by which side 2 moves down.
        slope: First derivative of the stiffness over the spread.
        curvature: Second derivative.
    """

    stiffness: FloatArray
    shift_slope: FloatArray
    share_1: FloatArray
    share_2: FloatArray
    slope: FloatArray
    curvature: FloatArray

    @classmethod
    def of(cls, state: PairState) -> StiffnessParabola:
        """Return the parabola with value, slope and curvature of the stiffness at a state."""
        one, two = state.one, state.two
        stiffness = state.stiffness
        share_1, share_2 = two.sigma / stiffness, one.sigma / stiffness
        shift_slope = (one.zeta + two.zeta) / stiffness
        return cls(
            stiffness,
            shift_slope,
            share_1,
            share_2,
            slope=one.zeta * share_1 - two.zeta * share_2,
            curvature=(one.eta - shift_slope * one.zeta) * share_1 * share_1
            + (two.eta - shift_slope * two.zeta) * share_2 * share_2,
        )

    def slope_sum(self, growth: FloatArray, sign: FloatArray) -> FloatArray:
        """Return the sum of the slopes before and after a growth of the stiffness; `sign` is their sign.

        On a parabola growth = spread * sum / 2. Solved for the spread, this form of the root of a quadratic
        equation has no cancellation.
        """
        squared = self.slope * self.slope + 2 * self.curvature * growth
        return self.slope + sign * np.sqrt(np.maximum(squared, 0))


def first_guess(inner: PairState, inner_stiffness: FloatArray, demand: FloatArray, sign: FloatArray) -> Sides:
    """Return approximate deflections for a demanded stiffness, extrapolated from the inner end of the branch.

    Args:
        inner: Springs at the inner end.
        inner_stiffness: Joint stiffness there, NaN where tau_e cannot be carried.
        demand: Demanded joint stiffness.
        sign: 1 where the stiffness increases with the preload, else -1.
    """
    inner = inner.regularized()
    scale = np.maximum(inner_stiffness, MIN_SCALE_SHARE * demand)
    excess = scale * _quadratic_part(sign * (demand - inner_stiffness) / scale)
    parabola = StiffnessParabola.of(inner)
    spread = np.where(excess > 0, 2 * sign * excess / parabola.slope_sum(sign * excess, sign), 0.0)
    step_1, step_2 = parabola.share_1 * spread, -parabola.share_2 * spread
    correction = _shift_correction(inner, step_1, step_2, spread, demand)
    return inner.phi_1 + step_1 + correction, inner.phi_2 + step_2 + correction


def _quadratic_part(excess: FloatArray) -> FloatArray:
    """Return the excess of stiffness that the parabola at the inner end has where the stiffness has `excess`.

    Both relative to the stiffness there. For a stiffness that grows as cosh it is acosh(1 + excess)^2/2; many
    springs stiffen still faster.
    """
    excess = np.maximum(excess, 0)
    argument = np.log1p(excess + np.sqrt(excess * (excess + 2)))
    squared = argument * argument
    quadratic: FloatArray = squared * (0.5 - QUARTIC_COEFFICIENT * np.minimum(squared, MAX_SQUARED_ARGUMENT))
    return quadratic


def third_order_step(
    state: PairState, tau_e: FloatArray, demand: FloatArray, sign: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return steps of phi_1 and phi_2 towards tau_e and the demand, and the relative error after them."""
    parabola = StiffnessParabola.of(state)
    stiffness_error, torque_error = demand - parabola.stiffness, tau_e - state.torque
    shift, growth = torque_error / parabola.stiffness, stiffness_error - parabola.shift_slope * torque_error
    slope_sum = parabola.slope_sum(growth, sign)
    spread = 2 * growth / slope_sum
    step_1, step_2 = shift + parabola.share_1 * spread, shift - parabola.share_2 * spread
    correction = _shift_correction(state, step_1, step_2, spread, demand)
    shift_magnitude, missing_share = np.abs(shift), np.abs(stiffness_error) / demand
    shift_share = shift_magnitude / (np.abs(state.phi_1) + np.abs(state.phi_2))
    change = (
        np.abs(parabola.curvature / slope_sum) * (np.abs(spread) + shift_magnitude)
        + missing_share
        + shift_share
    )
    error = change * (change * missing_share + shift_share)
    return step_1 + correction, step_2 + correction, error


def _shift_correction(
    state: PairState, step_1: FloatArray, step_2: FloatArray, spread: FloatArray, stiffness: FloatArray
) -> FloatArray:
    """Return a further shift of both sides, from the tangent back to the curve of equal tau_e."""
    largest = MAX_CORRECTION_SHARE * np.abs(spread)
    return np.minimum(np.maximum(-state.linearization_error(step_1, step_2) / stiffness, -largest), largest)
