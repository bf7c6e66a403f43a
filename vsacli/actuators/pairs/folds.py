"""The outermost fold of a pair of springs: the critical point of the joint stiffness at the largest preload.

A map of it over the elastic torque is made once for the pair. From there one Newton step does for nearly
every sample.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.laws.state import SpringState
from vsacli.actuators.laws.tendon import Mirrored
from vsacli.actuators.pairs.balance import Balance, PairState
from vsacli.actuators.pairs.bracketing import bracketed_root
from vsacli.actuators.pairs.critical_curves import critical_curves
from vsacli.actuators.pairs.decoupling_matrix import Sides
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.compute.control_flow import Values, look_up, repeat, where_needed

MONOTONE_SLOPE_RATIO = 3.0
"""Most by which the slopes at the ends of a cubic exceed the mean so that it is monotone for sure."""

GUESS_RTOL = 1e-5
"""Relative distance to a fold, in deflection and in stiffness, of which one step leaves rounding only.

It squares the distance along the curve of equal tau_e, of which the stiffness has the square again; of the
torque balance it leaves the fourth power.
"""

MAX_NEWTON_STEPS = 12
"""Newton steps to a fold to which the map does not lead; three or four do."""

NEWTON_RTOL = 1e-9
"""Relative size of a step after which the next would be rounding."""


class FoldMap(NamedTuple):
    """Cells of tau_e, in each of which the outermost fold moves from one corner of a box to the other.

    Attributes:
        edges: torques between the cells, (cells + 1,), ascending.
        tau_e: torques at which the fold is at the corners, (2, cells); NaN where there is no fold.
        phi_1: deflections of side 1 there, (2, cells).
        phi_2: deflections of side 2 there, (2, cells).
        cubic_1: coefficients, from the constant on, of phi_1 over the share of the cell, (4, cells); of a
            straight line where a cubic with the slopes of the critical curve would turn around.
        cubic_2: the same of phi_2.
    """

    edges: FloatArray
    tau_e: FloatArray
    phi_1: FloatArray
    phi_2: FloatArray
    cubic_1: FloatArray
    cubic_2: FloatArray

    def cell(self, tau_e: FloatArray) -> IndexArray:
        """Index of the cell in which an elastic torque lies."""
        cell: IndexArray = np.searchsorted(self.edges[1:-1], tau_e, side="right")
        return cell


def map_folds(first: SpringLaw, second: SpringLaw) -> FoldMap:
    """The outermost folds of a pair over all elastic torques."""
    above = _positive_folds(first, second)
    below = _positive_folds(Mirrored(law=second), Mirrored(law=first))
    edges = np.concatenate((-below[0][:0:-1], above[0]))
    tau_e, phi_1, phi_2 = np.concatenate((-below[1][(0, 2, 1), ::-1, ::-1], above[1]), axis=-1)
    return FoldMap(edges, tau_e, phi_1, phi_2, *_cubics(first, second, tau_e, phi_1, phi_2))


def _positive_folds(first: SpringLaw, second: SpringLaw) -> tuple[FloatArray, FloatArray]:
    """Those of positive tau_e: edges, and tau_e, phi_1, phi_2 at the corners, (3, 2, cells)."""
    curves = list(critical_curves(first, second))
    knots = np.unique(np.concatenate([[0.0], *(curve.tau_e for curve in curves)]))
    middle = np.append((knots[:-1] + knots[1:]) / 2, np.inf)
    corners = np.full((3, 2, middle.size), np.nan)
    outermost = np.full(middle.size, -np.inf)
    for curve in curves:
        tau_e = curve.tau_e
        preload = np.interp(middle, tau_e, curve.preload, left=-np.inf, right=-np.inf)
        further = preload > outermost
        outermost[further] = preload[further]
        cell = np.clip(np.searchsorted(tau_e, middle[further]) - 1, 0, len(tau_e) - 2)
        for values, nodes in zip(corners, (tau_e, curve.phi_1, curve.phi_2), strict=True):
            values[:, further] = nodes[cell], nodes[cell + 1]
    changes = np.flatnonzero(_differ(corners[0, :, 1:], corners[0, :, :-1])) + 1
    cells = np.append(0, changes)
    return np.append(knots[cells], np.inf), corners[:, :, cells]


def _differ(cells: FloatArray, others: FloatArray) -> BoolArray:
    differ: BoolArray = ~np.all((cells == others) | (np.isnan(cells) & np.isnan(others)), axis=0)
    return differ


def _cubics(
    first: SpringLaw, second: SpringLaw, tau_e: FloatArray, phi_1: FloatArray, phi_2: FloatArray
) -> Iterator[FloatArray]:
    """Hermite's cubics of phi_1 and phi_2 in each cell, with the slopes of the critical curve."""
    with np.errstate(all="ignore"):  # vertical at a cusp, unknown without stiffness, and far away
        state = Balance(first, second).state(phi_1, phi_2)
        slopes = _along_critical_curve(state, state.rho)
        for phi, slope in zip((phi_1, phi_2), slopes[:2], strict=True):
            rise = phi[1] - phi[0]
            shares = slope * (tau_e[1] - tau_e[0])
            monotone = np.all((shares / rise >= 0) & (shares / rise <= MONOTONE_SLOPE_RATIO), axis=0)
            start, end = np.where(monotone, shares, rise)
            yield np.stack((phi[0], start, 3 * rise - 2 * start - end, start + end - 2 * rise))


def _along_critical_curve(state: PairState, rho: Sides) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives of phi_1 and phi_2 over tau_e where rho_1 - rho_2 is kept, and their common divisor."""
    one, two = state.one, state.two
    rho_1, rho_2 = rho
    slope_1, slope_2 = one.eta / one.sigma - rho_1 * rho_1, two.eta / two.sigma - rho_2 * rho_2
    divisor = one.sigma * slope_2 + two.sigma * slope_1
    return slope_2 / divisor, slope_1 / divisor, divisor


def outermost_fold(balance: Balance, folds: FoldMap, tau_e: FloatArray) -> tuple[BoolArray, PairState]:
    """Whether there is a fold, and the state of the springs at the outermost; arrays (samples,)."""
    if np.isnan(folds.tau_e).all():
        nowhere = np.full_like(tau_e, np.nan)
        spring = SpringState(*[nowhere] * len(SpringState._fields))
        return np.zeros_like(tau_e, dtype=bool), PairState(nowhere, nowhere, spring, spring)
    low, high, *cubics = look_up((*folds.tau_e, *folds.cubic_1, *folds.cubic_2), folds.cell(tau_e))
    share = (tau_e - low) / (high - low)
    guess = balance.state(_cubic(share, *cubics[:4]), _cubic(share, *cubics[4:]))
    rho = guess.rho
    steps = _newton_step(guess, rho, tau_e)
    exists = ~np.isnan(low)
    fold = where_needed(
        exists & ~_is_short(guess, rho, steps),
        lambda tau_e: _safeguarded(balance, folds, tau_e),
        (tau_e,),
        guess.after(*steps).values,
    )
    return exists, PairState.of(fold)


def _cubic(x: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    return a + x * (b + x * (c + x * d))


def _newton_step(state: PairState, rho: Sides, tau_e: FloatArray) -> Sides:
    """A Newton step on tau_1 + tau_2 = tau_e, rho_1 = rho_2, which keeps the first to the third order."""
    one, two = state.one, state.two
    (rho_1, rho_2), (along_1, along_2, divisor) = rho, _along_critical_curve(state, rho)
    torque, apart = tau_e - state.torque, (rho_1 - rho_2) / divisor
    step_1, step_2 = torque * along_1 - apart * two.sigma, torque * along_2 + apart * one.sigma
    error = state.linearization_error(step_1, step_2)
    return step_1 - error * along_1, step_2 - error * along_2


def _is_short(state: PairState, rho: Sides, steps: Sides) -> BoolArray:
    """Whether a step is so short that the next would be rounding."""
    (rho_1, rho_2), (size_1, size_2) = rho, map(np.abs, steps)
    hardened = np.abs(rho_1) * size_1 + np.abs(rho_2) * size_2
    short: BoolArray = (hardened <= GUESS_RTOL) & (
        size_1 + size_2 <= GUESS_RTOL * (np.abs(state.phi_1) + np.abs(state.phi_2))
    )
    return short


def _safeguarded(balance: Balance, folds: FoldMap, tau_e: FloatArray) -> Values:
    """The fold within the box of its cell: by Newton's method from its middle, else by bracketing."""

    def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
        (phi_1, phi_2, _), (tau_e, low_1, high_1, low_2, high_2) = state, constants
        springs = balance.state(phi_1, phi_2)
        step_1, step_2 = _newton_step(springs, springs.rho, tau_e)
        change = (np.abs(step_1) + np.abs(step_2)) / (np.abs(phi_1) + np.abs(phi_2))
        next_point = np.clip(phi_1 + step_1, low_1, high_1), np.clip(phi_2 + step_2, low_2, high_2)
        return (*next_point, change), ~(change > NEWTON_RTOL)

    corners = look_up((*folds.phi_1, *folds.phi_2), folds.cell(tau_e))
    low_1, high_1, low_2, high_2 = box = (*_sorted(*corners[:2]), *_sorted(*corners[2:]))
    middle = (low_1 + high_1) / 2, (low_2 + high_2) / 2
    *found, change = repeat(step, (*middle, np.zeros_like(tau_e)), (tau_e, *box), MAX_NEWTON_STEPS)
    phi_1, phi_2 = where_needed(
        ~(change <= NEWTON_RTOL), lambda *known: _bracketed(balance, *known), (tau_e, *box), tuple(found)
    )
    return balance.state(phi_1, phi_2).values


def _sorted(one: FloatArray, other: FloatArray) -> Values:
    return np.minimum(one, other), np.maximum(one, other)


def _bracketed(balance: Balance, tau_e: FloatArray, *box: FloatArray) -> Values:
    """The fold within its box by bracketing the preload torque."""
    low_1, high_1, low_2, high_2 = box
    first, second = balance.first.torque, balance.second.torque
    least = np.maximum(first(low_1), tau_e - second(high_2)) - tau_e / 2
    largest = np.minimum(first(high_1), tau_e - second(low_2)) - tau_e / 2

    def slope(t: FloatArray, tau_e: FloatArray) -> FloatArray:
        return balance.stiffness_slope(*balance.deflections_at(tau_e, t))

    t = bracketed_root(slope, least, largest, (tau_e,))
    return balance.deflections_at(tau_e, t)
