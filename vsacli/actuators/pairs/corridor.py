"""The branch of (14) and its attainable range: the outermost monotone piece of the stiffness over preload.

Where the two torques have opposite signs, rho_1 > 0 > rho_2, since the springs harden away from zero. So the
joint stiffness has critical points only where the torques have the same sign. From the outermost of these
points to the end of the laws' domain the stiffness is monotone over the preload: this piece is the branch.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import SpringState
from vsacli.actuators.pairs.balance import Balance, PairState, spring_under_torque
from vsacli.actuators.pairs.folds import FoldMap, outermost_fold
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, where_needed

SMALLEST_PRELOAD, LARGEST_PRELOAD = 0, 1
"""Ends of the preload torque: side 1 is at this end of its domain, or side 2 at the opposite end of its."""


class PieceEnd(NamedTuple):
    """Deflections at an end of the piece, and the joint stiffness there; arrays (samples,).

    Where nothing ends the piece, the stiffness is infinite and the deflections are their limits.
    """

    phi_1: FloatArray
    phi_2: FloatArray
    stiffness: FloatArray


class Corridor(NamedTuple):
    """The piece between its ends; arrays (samples,).

    Attributes:
        inner: End at the smaller preload; its stiffness is NaN where tau_e cannot be carried.
        outer: End at the larger preload, as above.
        rising: Whether the stiffness increases with the preload.
        critical: Whether the inner end is a critical point (else the end of a law's domain).
        slack: Whether a tendon carries no torque at the inner end.
        state: Both springs at the inner end.
    """

    inner: PieceEnd
    outer: PieceEnd
    rising: BoolArray
    critical: BoolArray
    slack: BoolArray
    state: PairState


def corridor(balance: Balance, folds: FoldMap, tau_e: FloatArray) -> Corridor:
    """Return the monotone piece that extends to the largest preload, for each tau_e (samples,)."""
    smallest, largest = balance.preload_range(tau_e)
    carried = smallest <= largest
    exists, fold = outermost_fold(balance, folds, tau_e)
    critical = carried & exists & ((tau_e != 0) | ((smallest < 0) & (largest > 0)))
    inner = PairState.of(
        _evaluate_at_end(
            balance, SMALLEST_PRELOAD, tau_e, carried & ~critical, fold.values, lambda state: state.values
        )
    )
    outer = PieceEnd(
        *_evaluate_at_end(
            balance, LARGEST_PRELOAD, tau_e, carried, _end_at_infinite_preload(balance, tau_e), _piece_end
        )
    )
    return Corridor(
        inner=_nan_unless_carried(_piece_end(inner), carried),
        outer=_nan_unless_carried(outer, carried),
        rising=outer.stiffness >= inner.stiffness,
        critical=critical,
        slack=balance.is_slack(tau_e, smallest),
        state=inner,
    )


def _piece_end(state: PairState) -> PieceEnd:
    return PieceEnd(state.phi_1, state.phi_2, state.stiffness)


def _end_at_infinite_preload(balance: Balance, tau_e: FloatArray) -> PieceEnd:
    """Return the limit of the springs for a preload that grows without bound."""
    phi_1 = balance.first.domain[LARGEST_PRELOAD]
    phi_2 = balance.second.domain[1 - LARGEST_PRELOAD]
    return PieceEnd(*(np.full_like(tau_e, value) for value in (phi_1, phi_2, np.inf)))


def _nan_unless_carried(end: PieceEnd, carried: BoolArray) -> PieceEnd:
    return end._replace(stiffness=np.where(carried, end.stiffness, np.nan))


def _evaluate_at_end(
    balance: Balance,
    end: int,
    tau_e: FloatArray,
    mask: BoolArray,
    otherwise: Values,
    values_of: Callable[[PairState], Values],
) -> Values:
    """Return values of the springs at an end of the preload; arrays (samples,).

    Args:
        balance: Springs.
        end: `SMALLEST_PRELOAD` or `LARGEST_PRELOAD`.
        tau_e: Elastic torque.
        mask: Samples at which to compute the values.
        otherwise: Values elsewhere, and where the preload has no end.
        values_of: Function from the state at the end to the values, as many as in `otherwise`.
    """
    first, second = balance.first, balance.second
    tau_1, tau_2 = first.torque_range[end], second.torque_range[1 - end]
    first_ends = tau_1 <= tau_e - tau_2 if end == LARGEST_PRELOAD else tau_1 >= tau_e - tau_2

    def values_at_first_end(tau_e: FloatArray) -> Values:
        phi_1 = np.full_like(tau_e, first.domain[end])
        phi_2, two = spring_under_torque(second, tau_e - tau_1)
        return values_of(PairState(phi_1, phi_2, _broadcast_state(balance.domain_ends[0][end], tau_e), two))

    def values_at_second_end(tau_e: FloatArray) -> Values:
        phi_1, one = spring_under_torque(first, tau_e - tau_2)
        phi_2 = np.full_like(tau_e, second.domain[1 - end])
        return values_of(
            PairState(phi_1, phi_2, one, _broadcast_state(balance.domain_ends[1][1 - end], tau_e))
        )

    values = otherwise
    if math.isfinite(tau_1):
        values = where_needed(mask & first_ends, values_at_first_end, (tau_e,), values)
    if math.isfinite(tau_2):
        values = where_needed(mask & ~first_ends, values_at_second_end, (tau_e,), values)
    return values


def _broadcast_state(state: SpringState, like: FloatArray) -> SpringState:
    return SpringState(*(np.full_like(like, value) for value in state))
