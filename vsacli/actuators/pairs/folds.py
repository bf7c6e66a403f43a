"""The outermost fold of a pair of springs: the critical point of the joint stiffness at the largest preload.

From the map of it over the elastic torque, which is made once for the pair, one Newton step does for nearly
every sample.
"""

from __future__ import annotations

import numpy as np

from vsacli.actuators.laws.state import SpringState
from vsacli.actuators.pairs.balance import Balance, PairState
from vsacli.actuators.pairs.critical_points import bracketed_in_box, is_short, newton_step
from vsacli.actuators.pairs.fold_map import FoldMap
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, repeat, where_needed
from vsacli.compute.rounding import OfRounding

MAX_NEWTON_STEPS = 12
"""Newton steps to a fold to which the map does not lead; three or four do."""

NEWTON_RTOL = OfRounding(1e-9, power=0.5)
"""Relative size of a step after which the next would be rounding."""


def outermost_fold(balance: Balance, folds: FoldMap, tau_e: FloatArray) -> tuple[BoolArray, PairState]:
    """Whether there is a fold, and the state of the springs at the outermost; arrays (samples,)."""
    if np.isnan(folds.phi_1).all():
        nowhere = np.full_like(tau_e, np.nan)
        spring = SpringState(*[nowhere] * len(SpringState._fields))
        return np.zeros_like(tau_e, dtype=bool), PairState(nowhere, nowhere, spring, spring)
    exists, near, corners = folds.guess(tau_e)
    box = (*_sorted(*corners[:2]), *_sorted(*corners[2:]))
    guess = balance.state(*near)
    rho = guess.rho
    steps = newton_step(guess, rho, tau_e)
    fold = where_needed(
        exists & ~is_short(guess, rho, steps),
        lambda *known: _safeguarded(balance, *known),
        (tau_e, *near, *box),
        guess.after(*_within(box, near, steps)).values,
    )
    return exists, PairState.of(fold)


def _within(box: Values, near: Values, steps: Values) -> Values:
    """Steps that do not leave the box.

    Rounding of the elastic torque would, where one spring is stretched 1e16 times farther than the other.
    """
    low_1, high_1, low_2, high_2 = box
    (near_1, near_2), (step_1, step_2) = near, steps
    return np.clip(step_1, low_1 - near_1, high_1 - near_1), np.clip(step_2, low_2 - near_2, high_2 - near_2)


def _safeguarded(
    balance: Balance, tau_e: FloatArray, guess_1: FloatArray, guess_2: FloatArray, *box: FloatArray
) -> Values:
    """The fold between two corners of a box: by Newton's method from a guess, else by bracketing."""

    def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
        (phi_1, phi_2, _), (tau_e, low_1, high_1, low_2, high_2) = state, constants
        springs = balance.state(phi_1, phi_2)
        step_1, step_2 = newton_step(springs, springs.rho, tau_e)
        change = (np.abs(step_1) + np.abs(step_2)) / (np.abs(phi_1) + np.abs(phi_2))
        next_point = np.clip(phi_1 + step_1, low_1, high_1), np.clip(phi_2 + step_2, low_2, high_2)
        return (*next_point, change), ~(change > NEWTON_RTOL)

    low_1, high_1, low_2, high_2 = box
    start = np.clip(guess_1, low_1, high_1), np.clip(guess_2, low_2, high_2)
    *found, change = repeat(step, (*start, np.zeros_like(tau_e)), (tau_e, *box), MAX_NEWTON_STEPS)
    phi_1, phi_2 = where_needed(
        ~(change <= NEWTON_RTOL),
        lambda *known: bracketed_in_box(balance, *known),
        (tau_e, *box),
        tuple(found),
    )
    return balance.state(phi_1, phi_2).values


def _sorted(one: FloatArray, other: FloatArray) -> Values:
    return np.minimum(one, other), np.maximum(one, other)
