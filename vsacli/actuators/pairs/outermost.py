"""The outermost fold of a pair under an elastic torque: the critical point at the largest preload."""

from __future__ import annotations

import numpy as np

from vsacli.actuators.bracketing import bracketed_root
from vsacli.actuators.laws.state import SpringState
from vsacli.actuators.pairs.balance import Balance
from vsacli.actuators.pairs.decoupling_matrix import Sides
from vsacli.actuators.pairs.folds import Folds, along_equal_hardening
from vsacli.actuators.pairs.state import PairState
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.compute.control_flow import Values, look_up, repeat, where_needed

CLOSE = 1e-5
"""Relative distance to a fold, in deflection and in stiffness, of which one step leaves rounding only.

It squares the distance along the curve of equal tau_e, of which the stiffness has the square again; of the
torque balance it leaves the fourth power.
"""

MOST_STEPS = 12
"""Newton steps to a fold to which the map does not lead; three or four do."""

LAST_STEP = 1e-9
"""Relative size of a step after which the next would be rounding."""


def outermost_fold(balance: Balance, folds: Folds, tau_e: FloatArray) -> tuple[BoolArray, PairState]:
    """Whether there is one, and the springs there; arrays (samples,)."""
    if np.isnan(folds.tau_e).all():
        nowhere = np.full_like(tau_e, np.nan)
        spring = SpringState(*[nowhere] * len(SpringState._fields))
        return np.zeros_like(tau_e, dtype=bool), PairState(nowhere, nowhere, spring, spring)
    cell = _cell(folds, tau_e)
    low, high, *ways = look_up((*folds.tau_e, *folds.way_1, *folds.way_2), cell)
    share = (tau_e - low) / (high - low)
    guess = balance.state(_cubic(share, *ways[:4]), _cubic(share, *ways[4:]))
    rho = guess.rho
    steps = _step(guess, rho, tau_e)
    known = ~np.isnan(low)
    fold = where_needed(
        known & ~_is_short(guess, rho, steps),
        lambda tau_e: _searched(balance, folds, tau_e),
        (tau_e,),
        guess.moved(*steps).values,
    )
    return known, PairState.of(fold)


def _cell(folds: Folds, tau_e: FloatArray) -> IndexArray:
    cell: IndexArray = np.searchsorted(folds.edges[1:-1], tau_e, side="right")
    return cell


def _cubic(x: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    return a + x * (b + x * (c + x * d))


def _step(state: PairState, rho: Sides, tau_e: FloatArray) -> Sides:
    """A Newton step on tau_1 + tau_2 = tau_e, rho_1 = rho_2, which keeps the first to the third order."""
    one, two = state.one, state.two
    (rho_1, rho_2), (along_1, along_2, divisor) = rho, along_equal_hardening(state, rho)
    torque, apart = tau_e - state.torque, (rho_1 - rho_2) / divisor
    step_1, step_2 = torque * along_1 - apart * two.sigma, torque * along_2 + apart * one.sigma
    bent = state.bent(step_1, step_2)
    return step_1 - bent * along_1, step_2 - bent * along_2


def _is_short(state: PairState, rho: Sides, steps: Sides) -> BoolArray:
    (rho_1, rho_2), (size_1, size_2) = rho, map(np.abs, steps)
    hardened = np.abs(rho_1) * size_1 + np.abs(rho_2) * size_2
    short: BoolArray = (hardened <= CLOSE) & (
        size_1 + size_2 <= CLOSE * (np.abs(state.phi_1) + np.abs(state.phi_2))
    )
    return short


def _searched(balance: Balance, folds: Folds, tau_e: FloatArray) -> Values:
    """The fold within the box of its cell: by Newton's method from its middle, else by bracketing."""

    def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
        (phi_1, phi_2, _), (tau_e, low_1, high_1, low_2, high_2) = state, constants
        springs = balance.state(phi_1, phi_2)
        step_1, step_2 = _step(springs, springs.rho, tau_e)
        change = (np.abs(step_1) + np.abs(step_2)) / (np.abs(phi_1) + np.abs(phi_2))
        moved = np.clip(phi_1 + step_1, low_1, high_1), np.clip(phi_2 + step_2, low_2, high_2)
        return (*moved, change), ~(change > LAST_STEP)

    corners = look_up((*folds.phi_1, *folds.phi_2), _cell(folds, tau_e))
    low_1, high_1, low_2, high_2 = box = (*_sorted(*corners[:2]), *_sorted(*corners[2:]))
    middle = (low_1 + high_1) / 2, (low_2 + high_2) / 2
    *found, change = repeat(step, (*middle, np.zeros_like(tau_e)), (tau_e, *box), MOST_STEPS)
    phi_1, phi_2 = where_needed(
        ~(change <= LAST_STEP), lambda *known: _bracketed(balance, *known), (tau_e, *box), tuple(found)
    )
    return balance.state(phi_1, phi_2).values


def _sorted(one: FloatArray, other: FloatArray) -> Values:
    return np.minimum(one, other), np.maximum(one, other)


def _bracketed(balance: Balance, tau_e: FloatArray, *box: FloatArray) -> Values:
    """The same by bracketing along the torque balance."""
    low_1, high_1, low_2, high_2 = box
    first, second = balance.first.torque, balance.second.torque
    least = np.maximum(first(low_1), tau_e - second(high_2)) - tau_e / 2
    largest = np.minimum(first(high_1), tau_e - second(low_2)) - tau_e / 2
    t = bracketed_root(lambda t, tau_e: balance.slope(*balance.at(tau_e, t)), least, largest, (tau_e,))
    return balance.at(tau_e, t)
