"""The point of a monotone piece at which the joint stiffness is the demanded one."""

from __future__ import annotations

import numpy as np

from vsacli.arrays import BoolArray, FloatArray
from vsacli.loops import Values, repeat, where_needed
from vsacli.springs.balance import Balance
from vsacli.springs.bracketing import bracketed_root
from vsacli.springs.corridor import Corridor

MOST_STEPS = 30
"""Newton steps; four to eight do, except next to the birth of folds."""

LAST_STEP = 1e-9
"""Relative size of a step after which the next would be rounding."""

ROUNDING = 4 * float(np.finfo(float).eps)
"""Relative residual of (14) that is none."""

MOST_DOUBLINGS = 1000
"""From about the demand on, a preload torque leaves the range of numbers before."""

MOST_TURN = 0.25
"""Largest share of the way by which the curve of equal tau_e is taken to bend off its tangent."""

SHORT = 0.01
"""Share of the way to the demand that counts as gone where the stiffness is still short of the inner end."""

SMALL = 1e-4
"""Share of the demand below which the stiffness at the inner end is no measure for it."""


def deflections_at(balance: Balance, piece: Corridor, tau_e: FloatArray, demand: FloatArray) -> Values:
    """phi_1 and phi_2 where the piece has a stiffness, which lies within its ends; arrays (samples,)."""
    sign = np.where(piece.rising, 1.0, -1.0)
    inner, outer = piece.inner, piece.outer
    scale = np.maximum(inner.stiffness, SMALL * demand)
    reach = stretch(sign * (demand - inner.stiffness) / scale)
    start = _first_guess(piece, scale * reach * reach / 2)
    ends = inner.phi_1, outer.phi_1, inner.phi_2, outer.phi_2, outer.stiffness
    phi_1, phi_2, change = repeat(
        lambda state, constants: _towards_demand(balance, state, constants),
        (*start, np.zeros_like(tau_e)),
        (tau_e, demand, reach, inner.stiffness, sign * scale, *ends),
        MOST_STEPS,
    )
    return where_needed(
        ~(change <= LAST_STEP) & ~np.isnan(demand),
        lambda *known: _bracketed(balance, *known),
        (tau_e, demand, inner.phi_1),
        (phi_1, phi_2),
    )


def stretch(excess: FloatArray) -> FloatArray:
    """acosh(1 + excess): about linear in the deflections, near a fold and where the springs grow stiff."""
    beyond = np.maximum(excess, 0)
    stretched: FloatArray = np.log1p(beyond + np.sqrt(beyond * (beyond + 2)))
    return stretched


def _first_guess(piece: Corridor, excess: FloatArray) -> Values:
    """From the inner end along the tangent of tau_1 + tau_2 = tau_e, by two derivatives of the stiffness."""
    phi_1, phi_2, stiffness = piece.inner
    (_, sigma_1, zeta_1, eta_1), (_, sigma_2, zeta_2, eta_2) = piece.states
    slack = stiffness == 0
    total = np.where(slack, 1.0, stiffness)
    share_1, share_2 = np.where(slack, 0.5, sigma_2 / total), np.where(slack, 0.5, sigma_1 / total)
    slope = zeta_1 * share_1 - zeta_2 * share_2
    straight = eta_1 * share_1**2 + eta_2 * share_2**2
    turn = (zeta_2 * share_2 * stiffness + sigma_2 * slope) / (total * total)
    bend = np.maximum(straight - (zeta_1 + zeta_2) * turn, straight / 2)
    steepness = np.abs(slope) + np.sqrt(slope * slope + 2 * bend * excess)
    spread = np.where(excess > 0, 2 * excess / steepness, 0.0)
    aside = np.clip(turn * spread / 2, -MOST_TURN, MOST_TURN) * spread
    outer = piece.outer
    return (
        _short_of(phi_1, np.maximum(phi_1 + share_1 * spread - aside, phi_1), outer.phi_1, outer.stiffness),
        -_short_of(
            -phi_2, np.maximum(-phi_2 + share_2 * spread + aside, -phi_2), -outer.phi_2, outer.stiffness
        ),
    )


def _towards_demand(balance: Balance, state: Values, constants: Values) -> tuple[Values, BoolArray]:
    """A Newton step on (14), with the stiffness stretched until it is nearly met."""
    phi_1, phi_2, _ = state
    tau_e, demand, reach, end, scale, inner_1, outer_1, inner_2, outer_2, largest = constants
    tau_1, sigma_1, zeta_1 = balance.first.derivatives(phi_1, 2)
    tau_2, sigma_2, zeta_2 = balance.second.derivatives(phi_2, 2)
    torque, missing = tau_e - tau_1 - tau_2, demand - (sigma_1 + sigma_2)
    balanced = np.abs(torque) <= ROUNDING * (np.abs(tau_1) + np.abs(tau_2))
    met = (demand == end) | (balanced & (np.abs(missing) <= ROUNDING * demand))
    excess = np.maximum((sigma_1 + sigma_2 - end) / scale, np.abs(SHORT * (demand - end) / scale))
    stretched = scale * (reach - stretch(excess)) * np.sqrt(excess * (excess + 2))
    wanted = np.where(np.abs(missing) <= 0.01 * np.abs(demand - end), missing, stretched)
    divisor = sigma_1 * zeta_2 - sigma_2 * zeta_1
    step_1 = (zeta_2 * torque - sigma_2 * wanted) / divisor
    step_2 = (sigma_1 * wanted - zeta_1 * torque) / divisor
    change = np.where(met, 0.0, (np.abs(step_1) + np.abs(step_2)) / (np.abs(phi_1) + np.abs(phi_2)))
    moved_1 = _short_of(phi_1, _beyond(phi_1, phi_1 + step_1, inner_1), outer_1, largest)
    moved_2 = -_short_of(-phi_2, _beyond(-phi_2, -phi_2 - step_2, -inner_2), -outer_2, largest)
    return (np.where(met, phi_1, moved_1), np.where(met, phi_2, moved_2), change), ~(change > LAST_STEP)


def _beyond(here: FloatArray, there: FloatArray, inner: FloatArray) -> FloatArray:
    """There, or half way to the inner end if it lies on the other side of that."""
    return np.where(there < inner, (here + inner) / 2, there)


def _short_of(here: FloatArray, there: FloatArray, outer: FloatArray, largest: FloatArray) -> FloatArray:
    """There, but not beyond the outer end; half way to it instead if the stiffness grows without bound."""
    return np.where(there >= outer, np.where(np.isinf(largest), (here + outer) / 2, outer), there)


def _bracketed(balance: Balance, tau_e: FloatArray, demand: FloatArray, inner_1: FloatArray) -> Values:
    """The same by bracketing along the torque balance."""
    tau_1 = balance.first.torque(inner_1)
    tau_2 = tau_e - tau_1

    def missing(x: FloatArray, tau_1: FloatArray, tau_2: FloatArray, demand: FloatArray) -> FloatArray:
        return demand - balance.stiffness(*balance.under(tau_1 + x, tau_2 - x))

    least, largest = np.zeros_like(tau_e), balance.domain(tau_e)[1] + tau_e / 2 - tau_1
    endless = np.isinf(largest)
    guess = np.where(endless, np.abs(tau_1) + np.abs(tau_2) + demand, largest)

    def widened(state: Values, constants: Values) -> tuple[Values, BoolArray]:
        (width,) = state
        *known, endless = constants
        short = (endless > 0) & (missing(width, *known) > 0)
        return (np.where(short, 2 * width, width),), ~short

    known = tau_1, tau_2, demand
    (width,) = repeat(widened, (guess,), (*known, np.where(endless, 1.0, 0.0)), MOST_DOUBLINGS)
    x = bracketed_root(missing, least, width, known)
    return balance.under(tau_1 + x, tau_2 - x)
