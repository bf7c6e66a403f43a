"""The branch of (14): the outermost monotone piece of the joint stiffness over the preload.

Where the two torques have opposite signs, rho_1 > 0 > rho_2 (the springs harden away from zero), so that
the joint stiffness has critical points only where they have one sign. Towards larger preload from the
outermost of them, the piece is monotone to the end of the laws' domain.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.arrays import BoolArray, FloatArray
from vsacli.loops import Values, look_up, repeat, where_needed
from vsacli.springs.balance import Balance
from vsacli.springs.bracketing import bracketed_root
from vsacli.springs.folds import Folds

MOST_STEPS = 12
"""Newton steps to a fold; three or four do next to a node of the map."""

LAST_STEP = 1e-9
"""Relative size of a step after which the next would be rounding."""


class End(NamedTuple):
    """Deflections at an end of the piece, and the joint stiffness there; arrays (samples,).

    NaN where tau_e cannot be carried. Where the piece has no end, an infinite stiffness at the deflections
    that the laws come close to.
    """

    phi_1: FloatArray
    phi_2: FloatArray
    stiffness: FloatArray

    def where(self, carried: BoolArray) -> End:
        """The end where the torque can be carried."""
        return End(*(np.where(carried, values, np.nan) for values in self))


class Corridor(NamedTuple):
    """The piece between its ends; arrays (samples,).

    Attributes:
        inner: its end at the smaller preload.
        outer: its end at the larger preload.
        rising: whether the stiffness increases with the preload.
        critical: whether the inner end is a critical point (else the end of a law's domain).
        slack: whether a side that only pulls carries no torque at the inner end.
        states: torque, stiffness, slope and curvature of both springs at the inner end.
    """

    inner: End
    outer: End
    rising: BoolArray
    critical: BoolArray
    slack: BoolArray
    states: tuple[Values, Values]


def corridor(balance: Balance, folds: Folds, tau_e: FloatArray) -> Corridor:
    """The piece of the joint stiffness that reaches the largest preload, for each tau_e (samples,)."""
    least, largest = balance.domain(tau_e)
    carried = least <= largest
    fold = _outermost_fold(balance, folds, tau_e)
    critical = carried & ~np.isnan(fold[0]) & ((tau_e != 0) | ((least < 0) & (largest > 0)))
    phi_1, phi_2 = where_needed(carried & ~critical, balance.at, (tau_e, least), fold)
    farthest_1, farthest_2 = balance.first.domain[1], balance.second.domain[0]
    endless = np.full_like(tau_e, np.inf)
    outer = where_needed(
        carried & (largest < np.inf),
        lambda tau_e, t: _outer_end(balance, tau_e, t),
        (tau_e, largest),
        (np.full_like(tau_e, farthest_1), np.full_like(tau_e, farthest_2), endless, endless),
    )
    states = balance.first.derivatives(phi_1, 3), balance.second.derivatives(phi_2, 3)
    return Corridor(
        inner=End(phi_1, phi_2, states[0][1] + states[1][1]).where(carried),
        outer=End(outer[0], outer[1], outer[2]).where(carried),
        rising=outer[3] >= 0,
        critical=critical,
        slack=balance.is_slack(tau_e, least),
        states=states,
    )


def _outer_end(balance: Balance, tau_e: FloatArray, t: FloatArray) -> Values:
    """Deflections, stiffness and its slope where the outer end of the piece is one of a law."""
    phi_1, phi_2 = balance.at(tau_e, t)
    _, sigma_1, zeta_1 = balance.first.derivatives(phi_1, 2)
    _, sigma_2, zeta_2 = balance.second.derivatives(phi_2, 2)
    return phi_1, phi_2, sigma_1 + sigma_2, zeta_1 / sigma_1 - zeta_2 / sigma_2


def _outermost_fold(balance: Balance, folds: Folds, tau_e: FloatArray) -> Values:
    """Deflections at the outermost critical point, by Newton's method within its box of the map."""
    if np.isnan(folds.tau_e).all():
        return np.full_like(tau_e, np.nan), np.full_like(tau_e, np.nan)
    cell = np.clip(np.searchsorted(folds.edges, tau_e, side="right") - 1, 0, len(folds.edges) - 2)
    (tau_0, tau_1), (from_1, to_1), (from_2, to_2) = (
        [look_up(corner, cell) for corner in corners] for corners in folds[1:]
    )
    share = (tau_e - tau_0) / (tau_1 - tau_0)
    start = from_1 + share * (to_1 - from_1), from_2 + share * (to_2 - from_2)
    box = (
        np.minimum(from_1, to_1),
        np.maximum(from_1, to_1),
        np.minimum(from_2, to_2),
        np.maximum(from_2, to_2),
    )
    phi_1, phi_2, change = repeat(
        lambda state, constants: _towards_fold(balance, state, constants),
        (*start, np.zeros_like(tau_e)),
        (tau_e, *box),
        MOST_STEPS,
    )
    return where_needed(
        ~(change <= LAST_STEP) & ~np.isnan(tau_0),
        lambda *known: _bracketed_fold(balance, *known),
        (tau_e, *box),
        (phi_1, phi_2),
    )


def _towards_fold(balance: Balance, state: Values, constants: Values) -> tuple[Values, BoolArray]:
    """A Newton step on tau_1 + tau_2 = tau_e, rho_1 = rho_2."""
    (phi_1, phi_2, _), (tau_e, low_1, high_1, low_2, high_2) = state, constants
    tau_1, sigma_1, zeta_1, eta_1 = balance.first.derivatives(phi_1, 3)
    tau_2, sigma_2, zeta_2, eta_2 = balance.second.derivatives(phi_2, 3)
    torque = tau_e - tau_1 - tau_2
    rho_1, rho_2 = zeta_1 / sigma_1, zeta_2 / sigma_2
    bend_1, bend_2 = eta_1 / sigma_1 - rho_1 * rho_1, eta_2 / sigma_2 - rho_2 * rho_2
    divisor = sigma_1 * bend_2 + sigma_2 * bend_1
    step_1 = (torque * bend_2 - (rho_1 - rho_2) * sigma_2) / divisor
    step_2 = (torque * bend_1 + (rho_1 - rho_2) * sigma_1) / divisor
    change = (np.abs(step_1) + np.abs(step_2)) / (np.abs(phi_1) + np.abs(phi_2))
    moved = np.clip(phi_1 + step_1, low_1, high_1), np.clip(phi_2 + step_2, low_2, high_2)
    return (*moved, change), ~(change > LAST_STEP)


def _bracketed_fold(
    balance: Balance,
    tau_e: FloatArray,
    low_1: FloatArray,
    high_1: FloatArray,
    low_2: FloatArray,
    high_2: FloatArray,
) -> Values:
    """The same by bracketing along the torque balance."""
    first, second = balance.first.torque, balance.second.torque
    least = np.maximum(first(low_1), tau_e - second(high_2)) - tau_e / 2
    largest = np.minimum(first(high_1), tau_e - second(low_2)) - tau_e / 2
    t = bracketed_root(lambda t, tau_e: balance.slope(*balance.at(tau_e, t)), least, largest, (tau_e,))
    return balance.at(tau_e, t)
