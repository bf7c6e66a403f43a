"""Solution of (14) for a preloaded cam: the deflection with a torque and a stiffness, between two ends.

Eliminating the compression of the spring from torque and stiffness gives
g(phi) = sigma l' - k l'^3 - tau_e l'' = 0, which is l' (sigma - G). Unlike G it is regular at rest; its root
is simple within the branch, double at a fold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.mechanisms.preloaded_cams.branch import FOLD, PEAK, PRETENSION, CamBranch
from vsacli.actuators.mechanisms.preloaded_cams.lift import Lift, LinearInTorque
from vsacli.actuators.pairs.bracketing import bracketed_root
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, repeat, where_needed

MAX_GUESS_ERROR = 1e-3
"""Largest relative correction of an end: next to a turning point of a curve a Newton step is arbitrary."""

STEP_RTOL = 3e-6
"""Relative size of a step after which the error, its third power, is rounding."""

MAX_STEPS = 12
"""Largest number of steps. Two or three suffice; nine were the most in random trials on a hundred cams."""

LEAST_CURVATURE_SHARE = 1e-3
"""Smallest curvature in the first guess, as a share of the lift's curvature at rest."""

AT_REST_SHARE = 1e-40
"""Share of the stiffness below which k l'^2 marks a deflection close to underflow, which counts as rest."""


class BranchEnd(NamedTuple):
    """An end of the branch: deflection from rest, and joint stiffness; arrays (samples,)."""

    phi: FloatArray
    stiffness: FloatArray


class BranchAtTorque(NamedTuple):
    """The branch at given torques.

    Attributes:
        outer: End at the largest pretension; its stiffness is NaN where the torque cannot be carried.
        inner: Other end, as above.
        at_fold: Whether that is a fold.
        sign: 1 where the stiffness falls from the outer to the inner end, else -1.
        curvature: Second derivative of the lift at the inner end.
    """

    outer: BranchEnd
    inner: BranchEnd
    at_fold: BoolArray
    sign: FloatArray
    curvature: FloatArray


@dataclass(frozen=True)
class CamSolver:
    """The solver of a cam.

    Attributes:
        lift: Over deflections from rest.
        domain: Least and largest deflection from rest.
        k: Stiffness of the spring, N/m.
        pretension: Smallest and largest, m.
        branch: Over the torque.
    """

    lift: Callable[[FloatArray], Lift]
    domain: tuple[float, float]
    k: float
    pretension: tuple[float, float]
    branch: CamBranch

    @cached_property
    def _least_curvature(self) -> float:
        return LEAST_CURVATURE_SHARE * float(self.lift(np.zeros(1)).l2[0])

    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Return deflections from rest (phi_1) and pretensions (phi_2); arrays (samples,)."""
        with np.errstate(all="ignore"):  # steps are arbitrary at torques that cannot be carried
            piece = self._branch_at_torque(tau_e)
            lower = np.minimum(piece.inner.stiffness, piece.outer.stiffness)
            upper = np.maximum(piece.inner.stiffness, piece.outer.stiffness)
            demand = np.minimum(np.maximum(stiffness, lower), upper)
            phi, lift = self._deflection_and_lift(piece, tau_e, demand)
            compression = self._spring_compression(lift, tau_e, demand)
        smallest, largest = self.pretension
        return PairSolution(
            lower=lower,
            upper=upper,
            lower_critical=piece.at_fold & (piece.sign > 0),
            upper_critical=piece.at_fold & (piece.sign < 0),
            slack_below=np.zeros_like(piece.at_fold),
            phi_1=np.where(np.isnan(demand), np.nan, phi),
            phi_2=np.minimum(np.maximum(compression - lift.l, smallest), largest),
        )

    def _branch_at_torque(self, tau_e: FloatArray) -> BranchAtTorque:
        """Return the branch between its ends."""
        k, (smallest, largest) = self.k, self.pretension
        guess = self.branch.ends(tau_e)
        is_pretension, is_fold, is_peak = guess.end == PRETENSION, guess.end == FOLD, guess.end == PEAK
        domain_end = np.where(guess.inner < 0, *self.domain)

        def outer_condition(lift: Lift, _: FloatArray) -> LinearInTorque:
            return lift.torque_error(k, largest)

        def inner_condition(lift: Lift, phi: FloatArray) -> LinearInTorque:
            return LinearInTorque(
                *(
                    np.where(is_pretension, a, np.where(is_fold, b, np.where(is_peak, c, d)))
                    for a, b, c, d in zip(
                        lift.torque_error(k, smallest),
                        lift.fold_condition(k),
                        lift.torque_peak_condition(k),
                        _distance_to_end(phi, domain_end),
                        strict=True,
                    )
                )
            )

        outer, outer_lift = self._correct_by_newton(guess.outer, tau_e, outer_condition)
        inner, inner_lift = self._correct_by_newton(guess.inner, tau_e, inner_condition)
        low, high = self.branch.torque_range
        is_carried = (tau_e >= low) & (tau_e <= high)
        stiffness = np.where(
            is_pretension, inner_lift.spring(k, smallest).sigma, inner_lift.stiffness(k, tau_e)
        )
        return BranchAtTorque(
            BranchEnd(outer, np.where(is_carried, outer_lift.spring(k, largest).sigma, np.nan)),
            BranchEnd(inner, np.where(is_carried, np.where(is_peak, 0.0, stiffness), np.nan)),
            is_fold,
            guess.sign,
            inner_lift.l2,
        )

    def _correct_by_newton(
        self, phi: FloatArray, tau_e: FloatArray, function: Callable[[Lift, FloatArray], LinearInTorque]
    ) -> tuple[FloatArray, Lift]:
        """Return the zero of a function after two Newton steps, and the lift there."""
        lift = self.lift(phi)
        step = _limited_newton_step(function(lift, phi), phi, tau_e)
        step = step + _limited_newton_step(function(lift.after(step), phi + step), phi, tau_e)
        return phi + step, lift.after(step)

    def _deflection_and_lift(
        self, piece: BranchAtTorque, tau_e: FloatArray, demand: FloatArray
    ) -> tuple[FloatArray, Lift]:
        """Return the deflection from rest with the demanded stiffness at the torque, and the lift there."""
        low = np.minimum(piece.outer.phi, piece.inner.phi)
        high = np.maximum(piece.outer.phi, piece.inner.phi)
        start = np.minimum(np.maximum(self._first_guess(piece, tau_e, demand), low), high)
        constants = (tau_e, demand, piece.sign)
        phi, _, _, error, *lift = repeat(
            self._parabola_step, (start, low, high, *[np.zeros_like(start)] * 6), constants, MAX_STEPS
        )
        phi, *lift = where_needed(
            ~(error <= STEP_RTOL) & ~np.isnan(demand),
            self._bracket_root,
            (tau_e, demand, low, high),
            (phi, *lift),
        )
        return phi, Lift(*lift)

    def _first_guess(self, piece: BranchAtTorque, tau_e: FloatArray, demand: FloatArray) -> FloatArray:
        """Return the root if the lift were a parabola, whose curvature is that at the inner end."""
        curvature = np.maximum(piece.curvature, self._least_curvature)
        scale = np.sqrt(demand / (3 * self.k))
        load = 1.5 * tau_e * curvature / (demand * scale)
        slope = 2 * scale * np.sin(np.arcsin(np.minimum(np.maximum(load, -1), 1)) / 3)
        return np.where(demand > 0, slope / curvature, piece.inner.phi)

    def _parabola_step(self, state: Values, constants: Values) -> tuple[Values, BoolArray]:
        """Return a step to the root of a parabola touching g, if between the ends; else to their middle."""
        (phi, low, high, *_), (tau_e, demand, sign) = state, constants
        lift = self.lift(phi)
        squared, growth = self.k * lift.l1 * lift.l1, self.k * lift.l1 * lift.l2
        stiffness_error = demand - 3 * squared
        g = lift.l1 * (demand - squared) - tau_e * lift.l2
        slope = lift.l2 * stiffness_error - tau_e * lift.l3
        curvature = lift.l3 * stiffness_error - 6 * growth * lift.l2 - tau_e * lift.l4
        low, high = np.where(sign * g <= 0, phi, low), np.where(sign * g >= 0, phi, high)
        slope_sum = slope + sign * np.sqrt(np.maximum(slope * slope - 2 * g * curvature, 0))
        target = phi - np.where(g == 0, 0.0, 2 * g / slope_sum)
        tolerance = STEP_RTOL * np.abs(phi)
        is_inside = (target >= low - tolerance) & (target <= high + tolerance)
        target = np.where(is_inside, np.minimum(np.maximum(target, low), high), (low + high) / 2)
        step = target - phi
        error = np.where(step == 0, 0.0, np.abs(step / phi))
        return (target, low, high, error, *lift.after(step)), ~(error > STEP_RTOL)

    def _bracket_root(
        self, tau_e: FloatArray, demand: FloatArray, low: FloatArray, high: FloatArray
    ) -> Values:
        """Return the deflection, and the lift there, by bracketing."""

        def g(phi: FloatArray, tau_e: FloatArray, demand: FloatArray) -> FloatArray:
            lift = self.lift(phi)
            return lift.l1 * (demand - self.k * lift.l1 * lift.l1) - tau_e * lift.l2

        phi = bracketed_root(g, low, high, (tau_e, demand))
        return phi, *self.lift(phi)

    def _spring_compression(self, lift: Lift, tau_e: FloatArray, demand: FloatArray) -> FloatArray:
        """Return the compression of the spring, from the torque; at rest, from the stiffness."""
        at_rest = self.k * lift.l1 * lift.l1 <= AT_REST_SHARE * demand
        return np.where(at_rest, demand / lift.l2, tau_e / lift.l1) / self.k


def _distance_to_end(phi: FloatArray, domain_end: FloatArray) -> LinearInTorque:
    """Return the distance to the end of the domain, zero there at any torque."""
    zero = np.zeros_like(phi)
    return LinearInTorque(phi - domain_end, np.ones_like(phi), zero, zero)


def _limited_newton_step(function: LinearInTorque, phi: FloatArray, tau_e: FloatArray) -> FloatArray:
    slope, largest = function.slope(tau_e), MAX_GUESS_ERROR * np.abs(phi)
    step = np.where(slope == 0, 0.0, -function.at(tau_e) / slope)
    return np.minimum(np.maximum(step, -largest), largest)
