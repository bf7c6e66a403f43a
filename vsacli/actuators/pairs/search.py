"""The point of a monotone piece at which the joint stiffness is the demanded one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.bracketing import bracketed_root
from vsacli.actuators.pairs.balance import Balance
from vsacli.actuators.pairs.corridor import Corridor
from vsacli.actuators.pairs.state import PairState
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, repeat, where_needed

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
    near = np.where(np.abs(outer.stiffness - demand) < demand, 1.0, 0.0)
    ends = inner.phi_1, outer.phi_1, inner.phi_2, outer.phi_2, near
    phi_1, phi_2, error = repeat(
        lambda state, constants: _towards_demand(balance, state, constants),
        (*_first_guess(piece, demand, sign, ends), np.zeros_like(tau_e)),
        (tau_e, demand, sign, inner.stiffness, *ends),
        MOST_STEPS,
    )
    return where_needed(
        ~(error <= NONE_LEFT) & ~np.isnan(demand),
        lambda *known: _bracketed(balance, *known),
        (tau_e, demand, inner.phi_1),
        (phi_1, phi_2),
    )


def _first_guess(piece: Corridor, demand: FloatArray, sign: FloatArray, ends: Values) -> Values:
    """From the inner end, as if the stiffness were quadratic along the curve of equal tau_e."""
    springs, inner = piece.springs.kept_stiff(), piece.inner
    scale = np.maximum(inner.stiffness, SMALL * demand)
    excess = scale * _curved(sign * (demand - inner.stiffness) / scale)
    course = _course(springs)
    spread = np.where(excess > 0, 2 * sign * excess / course.steepness(sign * excess, sign), 0.0)
    step_1, step_2 = course.share_1 * spread, -course.share_2 * spread
    aside = _aside(springs, step_1, step_2, spread, demand)
    held = inner.phi_1, inner.phi_2, inner.phi_1 + step_1 + aside, inner.phi_2 + step_2 + aside
    return where_needed(~_inside(*held[2:], *ends), _held, (*held, *ends), held[2:])


def _curved(excess: FloatArray) -> FloatArray:
    """The part of an excess that the curvature at the inner end makes.

    If the stiffness grows as cosh it is acosh(1 + excess)^2/2; many springs stiffen still faster.
    """
    beyond = np.maximum(excess, 0)
    stretched = np.log1p(beyond + np.sqrt(beyond * (beyond + 2)))
    squared = stretched * stretched
    curved: FloatArray = squared * (0.5 - FASTER * np.minimum(squared, FAR))
    return curved


class _Course(NamedTuple):
    """The stiffness along the curve of equal tau_e, over the spread phi_1 - phi_2; arrays (samples,).

    Attributes:
        stiffness: the stiffness itself.
        turn: its relative slope where both sides move up alike.
        share_1: of the spread, what side 1 moves up.
        share_2: what side 2 moves down.
        slope: first derivative of the stiffness.
        bend: second derivative.
    """

    stiffness: FloatArray
    turn: FloatArray
    share_1: FloatArray
    share_2: FloatArray
    slope: FloatArray
    bend: FloatArray

    def steepness(self, missing: FloatArray, sign: FloatArray) -> FloatArray:
        """Sum of the slopes before and after a growth of the stiffness."""
        squared = self.slope * self.slope + 2 * self.bend * missing
        return self.slope + sign * np.sqrt(np.maximum(squared, 0))


def _course(springs: PairState) -> _Course:
    one, two = springs.one, springs.two
    total = springs.stiffness
    share_1, share_2 = two.sigma / total, one.sigma / total
    turn = (one.zeta + two.zeta) / total
    return _Course(
        total,
        turn,
        share_1,
        share_2,
        slope=one.zeta * share_1 - two.zeta * share_2,
        bend=(one.eta - turn * one.zeta) * share_1 * share_1
        + (two.eta - turn * two.zeta) * share_2 * share_2,
    )


def _aside(
    springs: PairState, step_1: FloatArray, step_2: FloatArray, spread: FloatArray, stiffness: FloatArray
) -> FloatArray:
    """A further step of both sides to the curve of equal tau_e, which bends off its tangent."""
    most = MOST_TURN * np.abs(spread)
    return np.minimum(np.maximum(-springs.bent(step_1, step_2) / stiffness, -most), most)


def _towards_demand(balance: Balance, state: Values, constants: Values) -> tuple[Values, BoolArray]:
    """A step of third order on (14)."""
    phi_1, phi_2, _ = state
    tau_e, demand, sign, inner, *ends = constants
    springs = balance.state(phi_1, phi_2)
    step_1, step_2, error = _step(springs, tau_e, demand, sign)
    moved = phi_1 + step_1, phi_2 + step_2
    moved_1, moved_2, error = where_needed(
        (demand == inner) | ~_inside(*moved, *ends),
        _held_back,
        (demand, inner, error, phi_1, phi_2, *moved, *ends),
        (*moved, error),
    )
    return (moved_1, moved_2, error), ~(error > NONE_LEFT)


def _step(
    springs: PairState, tau_e: FloatArray, demand: FloatArray, sign: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Steps to tau_e and to the demand, and the relative error that they leave."""
    course = _course(springs)
    missing, unbalanced = demand - course.stiffness, tau_e - springs.torque
    shift, lacking = unbalanced / course.stiffness, missing - course.turn * unbalanced
    steepness = course.steepness(lacking, sign)
    spread = 2 * lacking / steepness
    step_1, step_2 = shift + course.share_1 * spread, shift - course.share_2 * spread
    aside = _aside(springs, step_1, step_2, spread, demand)
    shifted, lacked = np.abs(shift), np.abs(missing) / demand
    moved = shifted / _size(springs.phi_1, springs.phi_2)
    change = np.abs(course.bend / steepness) * (np.abs(spread) + shifted) + lacked + moved
    error = change * (change * lacked + moved)
    return step_1 + aside, step_2 + aside, error


def _inside(
    phi_1: FloatArray,
    phi_2: FloatArray,
    inner_1: FloatArray,
    outer_1: FloatArray,
    inner_2: FloatArray,
    outer_2: FloatArray,
    _near: FloatArray,
) -> BoolArray:
    """Between the ends, and not at the outer one."""
    inside: BoolArray = (inner_1 <= phi_1) & (phi_1 < outer_1) & (outer_2 < phi_2) & (phi_2 <= inner_2)
    return inside


def _held_back(
    demand: FloatArray,
    inner: FloatArray,
    error: FloatArray,
    phi_1: FloatArray,
    phi_2: FloatArray,
    *beyond: FloatArray,
) -> Values:
    """Where the step stays between the ends, or does not take place since the demand is met."""
    held_1, held_2 = _held(phi_1, phi_2, *beyond)
    met = demand == inner
    return np.where(met, phi_1, held_1), np.where(met, phi_2, held_2), np.where(met, 0.0, error)


def _held(
    phi_1: FloatArray,
    phi_2: FloatArray,
    moved_1: FloatArray,
    moved_2: FloatArray,
    inner_1: FloatArray,
    outer_1: FloatArray,
    inner_2: FloatArray,
    outer_2: FloatArray,
    near: FloatArray,
) -> Values:
    """Where a step stays between the ends."""
    return (
        _short_of(phi_1, _beyond(phi_1, moved_1, inner_1), outer_1, near > 0),
        -_short_of(-phi_2, _beyond(-phi_2, -moved_2, -inner_2), -outer_2, near > 0),
    )


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
