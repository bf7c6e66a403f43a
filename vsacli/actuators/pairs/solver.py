"""Solution of (14) for any two spring laws, on the outermost branch.

`corridor` finds the two ends of the branch. The stiffness is clipped to the range between them. An iteration
of third order, kept in the box between the ends, starts from a guess at the inner end. Samples at which it
does not converge are solved by bracketing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import Pair, PairSolution, SpringLaw, spring_state
from vsacli.actuators.pairs.balance import Balance, first_guess, third_order_step
from vsacli.actuators.pairs.bracketing import bracketed_root
from vsacli.actuators.pairs.corridor import Corridor, corridor
from vsacli.actuators.pairs.folds import FoldMap, map_folds
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, repeat, where_needed
from vsacli.compute.rounding import OfRounding

MAX_STEPS = 30
"""Largest number of steps. Three or four suffice, except next to a cusp or at extreme loads."""

ERROR_RTOL = OfRounding(1e-17)
"""Estimated relative error at which the iteration ends; the estimate may be some hundred times too small."""

MAX_DOUBLINGS = 1000
"""Largest number of doublings of a preload torque; its torque overflows before."""


@dataclass(frozen=True)
class IteratedPair(Pair):
    """Two laws without a closed solution, solved by iteration."""

    first: SpringLaw
    second: SpringLaw

    @cached_property
    def _balance(self) -> Balance:
        return Balance(self.first, self.second)

    @cached_property
    def _folds(self) -> FoldMap:
        return map_folds(self.first, self.second)

    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) for each sample; see `Pair.solve`."""
        balance, folds = self._balance, self._folds
        with np.errstate(all="ignore"):  # trial steps may leave the domain; they are rejected
            piece = corridor(balance, folds, tau_e)
            lower = np.minimum(piece.inner.stiffness, piece.outer.stiffness)
            upper = np.maximum(piece.inner.stiffness, piece.outer.stiffness)
            demand = np.minimum(np.maximum(stiffness, lower), upper)
            phi_1, phi_2 = _solve_between_ends(balance, piece, tau_e, demand)
        return PairSolution(
            lower=lower,
            upper=upper,
            lower_critical=piece.critical & piece.rising,
            upper_critical=piece.critical & ~piece.rising,
            slack_below=~piece.critical & piece.rising & piece.slack,
            phi_1=phi_1,
            phi_2=phi_2,
        )


class _Box(NamedTuple):
    """Box of the deflections between the ends of the piece, which contains the solution; arrays (samples,).

    Attributes:
        inner_1: Smallest phi_1, at the inner end.
        outer_1: Largest phi_1, at the outer end.
        inner_2: Largest phi_2, at the inner end.
        outer_2: Smallest phi_2, at the outer end.
        outer_near: 1 where the stiffness at the outer end is positive and less than twice the demand, else 0.
    """

    inner_1: FloatArray
    outer_1: FloatArray
    inner_2: FloatArray
    outer_2: FloatArray
    outer_near: FloatArray

    @classmethod
    def of(cls, piece: Corridor, demand: FloatArray) -> _Box:
        """Return the box of a piece."""
        inner, outer = piece.inner, piece.outer
        is_near = np.where(np.abs(outer.stiffness - demand) < demand, 1.0, 0.0)
        return cls(inner.phi_1, outer.phi_1, inner.phi_2, outer.phi_2, is_near)

    def contains(self, phi_1: FloatArray, phi_2: FloatArray) -> BoolArray:
        """Return whether deflections lie in the box, its outer sides excluded."""
        return (
            (self.inner_1 <= phi_1)
            & (phi_1 < self.outer_1)
            & (self.outer_2 < phi_2)
            & (phi_2 <= self.inner_2)
        )

    def confine(
        self, phi_1: FloatArray, phi_2: FloatArray, target_1: FloatArray, target_2: FloatArray
    ) -> Values:
        """Return the targets of a step from deflections in the box, moved back into it."""
        return (
            _limit_above(
                phi_1, _limit_below(phi_1, target_1, self.inner_1), self.outer_1, self.outer_near > 0
            ),
            -_limit_above(
                -phi_2, _limit_below(-phi_2, -target_2, -self.inner_2), -self.outer_2, self.outer_near > 0
            ),
        )


def _limit_below(start: FloatArray, target: FloatArray, inner: FloatArray) -> FloatArray:
    """Return the target; if it lies below the inner end, the point half way to that."""
    return np.where(target < inner, (start + inner) / 2, target)


def _limit_above(start: FloatArray, target: FloatArray, outer: FloatArray, near: BoolArray) -> FloatArray:
    """Return the target; if it lies beyond the outer end, that end, or half way there if it is not near."""
    return np.where(target >= outer, np.where(near, outer, (start + outer) / 2), target)


def _solve_between_ends(balance: Balance, piece: Corridor, tau_e: FloatArray, demand: FloatArray) -> Values:
    """Return phi_1 and phi_2 at which the piece has a stiffness between those at its ends; (samples,)."""
    sign = np.where(piece.rising, 1.0, -1.0)
    inner = piece.inner
    box = _Box.of(piece, demand)
    guess = first_guess(piece.state, inner.stiffness, demand, sign)
    start = where_needed(
        ~box.contains(*guess),
        lambda phi_1, phi_2, guess_1, guess_2, *box: _Box(*box).confine(phi_1, phi_2, guess_1, guess_2),
        (inner.phi_1, inner.phi_2, *guess, *box),
        guess,
    )
    phi_1, phi_2, error = repeat(
        lambda state, constants: _step_in_box(balance, state, constants),
        (*start, np.zeros_like(tau_e)),
        (tau_e, demand, sign, inner.stiffness, *box),
        MAX_STEPS,
    )
    return where_needed(
        ~(error <= ERROR_RTOL) & ~np.isnan(demand),
        lambda *unsolved: _bracket_preload(balance, *unsolved),
        (tau_e, demand, inner.phi_1),
        (phi_1, phi_2),
    )


def _step_in_box(balance: Balance, state: Values, constants: Values) -> tuple[Values, BoolArray]:
    """Return the state after a step of third order on (14), kept in the box, and whether it has converged."""
    phi_1, phi_2, _ = state
    tau_e, demand, sign, inner_stiffness, *bounds = constants
    step_1, step_2, error = third_order_step(balance.state(phi_1, phi_2), tau_e, demand, sign)
    target = phi_1 + step_1, phi_2 + step_2
    *next_point, error = where_needed(
        (demand == inner_stiffness) | ~_Box(*bounds).contains(*target),
        _confine_step,
        (demand, inner_stiffness, error, phi_1, phi_2, *target, *bounds),
        (*target, error),
    )
    return (*next_point, error), ~(error > ERROR_RTOL)


def _confine_step(
    demand: FloatArray,
    inner_stiffness: FloatArray,
    error: FloatArray,
    phi_1: FloatArray,
    phi_2: FloatArray,
    target_1: FloatArray,
    target_2: FloatArray,
    *bounds: FloatArray,
) -> Values:
    """Return a step moved back into the box, or no step if the demand is the stiffness at the inner end."""
    confined_1, confined_2 = _Box(*bounds).confine(phi_1, phi_2, target_1, target_2)
    is_inner_end = demand == inner_stiffness
    return (
        np.where(is_inner_end, phi_1, confined_1),
        np.where(is_inner_end, phi_2, confined_2),
        np.where(is_inner_end, 0.0, error),
    )


def _bracket_preload(balance: Balance, tau_e: FloatArray, demand: FloatArray, inner_1: FloatArray) -> Values:
    """Return phi_1 and phi_2 by bracketing the preload torque x in excess of that at the inner end."""
    tau_1 = spring_state(balance.first, inner_1).tau
    tau_2 = tau_e - tau_1

    def stiffness_error(
        x: FloatArray, tau_1: FloatArray, tau_2: FloatArray, demand: FloatArray
    ) -> FloatArray:
        return demand - balance.state_under(tau_1 + x, tau_2 - x).stiffness

    smallest, largest = np.zeros_like(tau_e), balance.preload_range(tau_e)[1] + tau_e / 2 - tau_1
    is_unbounded = np.isinf(largest)
    guess = np.where(is_unbounded, np.abs(tau_1) + np.abs(tau_2) + demand, largest)

    def widen(state: Values, constants: Values) -> tuple[Values, BoolArray]:
        (width,) = state
        *torques_and_demand, is_unbounded = constants
        is_short = (is_unbounded > 0) & (stiffness_error(width, *torques_and_demand) > 0)
        return (np.where(is_short, 2 * width, width),), ~is_short

    torques_and_demand = tau_1, tau_2, demand
    (width,) = repeat(widen, (guess,), (*torques_and_demand, np.where(is_unbounded, 1.0, 0.0)), MAX_DOUBLINGS)
    x = bracketed_root(stiffness_error, smallest, width, torques_and_demand)
    return balance.deflections(tau_1 + x, tau_2 - x)
