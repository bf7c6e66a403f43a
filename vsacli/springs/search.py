"""The point of a monotone piece at which the joint stiffness is the demanded one."""

from __future__ import annotations

import numpy as np

from vsacli.arrays import BoolArray, FloatArray
from vsacli.loops import Values, repeat, where_needed
from vsacli.springs.balance import Balance
from vsacli.springs.bracketing import bracketed_root
from vsacli.springs.corridor import Corridor
from vsacli.springs.state import PairState

MOST_STEPS = 30
"""Three or four do, except next to the birth of folds or far beyond what the springs are made for."""

NONE_LEFT = 1e-17
"""Relative error after a step that is none: the estimate may be some hundred times too small."""

MOST_DOUBLINGS = 1000
"""From about the demand on, a preload torque leaves the range of numbers before."""

MOST_TURN = 0.25
"""Largest share of the way by which the curve of equal tau_e is taken to bend off its tangent."""

FASTER, FAR = 0.025, 3.0
"""How much faster than cosh springs stiffen, and how far; by trial with all laws."""

SMALL = 1e-4
"""Share of the demand below which the stiffness at the inner end is no measure for it."""


def deflections_at(balance: Balance, piece: Corridor, tau_e: FloatArray, demand: FloatArray) -> Values:
    """phi_1 and phi_2 where the piece has a stiffness, which lies within its ends; arrays (samples,)."""
    sign = np.where(piece.rising, 1.0, -1.0)
    inner, outer = piece.inner, piece.outer
    scale = np.maximum(inner.stiffness, SMALL * demand)
    excess = scale * _curved(sign * (demand - inner.stiffness) / scale)
    near = np.where(np.abs(outer.stiffness - demand) < demand, 1.0, 0.0)
    start = _first_guess(piece, tau_e, sign, excess, near > 0)
    ends = inner.phi_1, outer.phi_1, inner.phi_2, outer.phi_2, near
    phi_1, phi_2, error = repeat(
        lambda state, constants: _towards_demand(balance, state, constants),
        (*start, np.zeros_like(tau_e)),
        (tau_e, demand, sign, inner.stiffness, *ends),
        MOST_STEPS,
    )
    return where_needed(
        ~(error <= NONE_LEFT) & ~np.isnan(demand),
        lambda *known: _bracketed(balance, *known),
        (tau_e, demand, inner.phi_1),
        (phi_1, phi_2),
    )


def _curved(excess: FloatArray) -> FloatArray:
    """The part of an excess that the curvature at the inner end makes.

    If the stiffness grows as cosh it is acosh(1 + excess)^2/2; many springs stiffen still faster.
    """
    beyond = np.maximum(excess, 0)
    stretched = np.log1p(beyond + np.sqrt(beyond * (beyond + 2)))
    squared = stretched * stretched
    curved: FloatArray = squared * (0.5 - FASTER * np.minimum(squared, FAR))
    return curved


def _first_guess(
    piece: Corridor, tau_e: FloatArray, sign: FloatArray, excess: FloatArray, near: BoolArray
) -> Values:
    """From the inner end, as if the stiffness were quadratic along the curve of equal tau_e."""
    springs, outer = piece.springs.kept_stiff(), piece.outer
    step_1, step_2, _ = _step(springs, tau_e, sign * excess, sign)
    step_1, step_2 = (np.where(excess > 0, step, 0.0) for step in (step_1, step_2))
    return (
        _short_of(springs.phi_1, springs.phi_1 + step_1, outer.phi_1, near),
        -_short_of(-springs.phi_2, -springs.phi_2 - step_2, -outer.phi_2, near),
    )


def _step(
    springs: PairState, tau_e: FloatArray, missing: FloatArray, sign: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Steps to tau_e and to a stiffness so much larger, of third order, and the relative error they leave."""
    one, two = springs.one, springs.two
    total, hardening = springs.stiffness, one.zeta + two.zeta
    share_1, share_2 = two.sigma / total, one.sigma / total
    slope = one.zeta * share_1 - two.zeta * share_2
    turn = (two.zeta * share_2 + share_1 * slope) / total
    bend = one.eta * share_1 * share_1 + two.eta * share_2 * share_2 - hardening * turn
    shift = (tau_e - springs.torque) / total
    lacking = missing - hardening * shift
    steepness = slope + sign * np.sqrt(np.maximum(slope * slope + 2 * bend * lacking, 0))
    spread = 2 * lacking / steepness
    step_1, step_2 = shift + share_1 * spread, shift - share_2 * spread
    demand, way = total + missing, np.abs(spread)
    most = MOST_TURN * way
    aside = np.clip((tau_e - springs.torque_after(step_1, step_2)) / demand, -most, most)
    shifted = np.abs(shift)
    change = np.abs(bend / steepness) * (way + shifted)
    error = change * (change * np.abs(missing) / demand + shifted / _size(springs.phi_1, springs.phi_2))
    return step_1 + aside, step_2 + aside, error


def _towards_demand(balance: Balance, state: Values, constants: Values) -> tuple[Values, BoolArray]:
    """A step of third order on (14)."""
    phi_1, phi_2, _ = state
    tau_e, demand, sign, inner, *ends = constants
    low_1, high_1, high_2, low_2, _ = ends
    springs = balance.state(phi_1, phi_2)
    missing = demand - springs.stiffness
    step_1, step_2, error = _step(springs, tau_e, missing, sign)
    moved_1, moved_2 = phi_1 + step_1, phi_2 + step_2
    inside = (low_1 <= moved_1) & (moved_1 < high_1) & (low_2 < moved_2) & (moved_2 <= high_2)
    moved_1, moved_2, error = where_needed(
        (demand == inner) | ~inside,
        _held_back,
        (demand, inner, phi_1, phi_2, moved_1, moved_2, error, *ends),
        (moved_1, moved_2, error),
    )
    return (moved_1, moved_2, error), ~(error > NONE_LEFT)


def _held_back(
    demand: FloatArray,
    inner: FloatArray,
    phi_1: FloatArray,
    phi_2: FloatArray,
    moved_1: FloatArray,
    moved_2: FloatArray,
    error: FloatArray,
    inner_1: FloatArray,
    outer_1: FloatArray,
    inner_2: FloatArray,
    outer_2: FloatArray,
    near: FloatArray,
) -> Values:
    """Where the step stays between the ends, or does not take place since the demand is met."""
    held_1 = _short_of(phi_1, _beyond(phi_1, moved_1, inner_1), outer_1, near > 0)
    held_2 = -_short_of(-phi_2, _beyond(-phi_2, -moved_2, -inner_2), -outer_2, near > 0)
    met = demand == inner
    return np.where(met, phi_1, held_1), np.where(met, phi_2, held_2), np.where(met, 0.0, error)


def _size(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.abs(one) + np.abs(other)


def _beyond(here: FloatArray, there: FloatArray, inner: FloatArray) -> FloatArray:
    """There, or half way to the inner end if it lies on the other side of that."""
    return np.where(there < inner, (here + inner) / 2, there)


def _short_of(here: FloatArray, there: FloatArray, outer: FloatArray, near: BoolArray) -> FloatArray:
    """There, but not beyond the outer end; half way to it if the demand is far from the stiffness there."""
    return np.where(there >= outer, np.where(near, outer, (here + outer) / 2), there)


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
