"""Continuation: where a potential has a torque and a stiffness, on the branch that a start names.

From the start on, torque and position of the joint are moved to those of the sample, by steps that stay on a
piece of a level curve on which A is regular; then the piece is followed to both ends, and to the stiffness
that is asked for. A step that might leave the piece is not taken.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.pair import PairSolution
from vsacli.actuators.mechanisms.potentials.level_curve import (
    CONTRACTION,
    LEAST_STEP,
    MAX_STEP,
    LevelCurves,
    Spot,
    length,
)
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, repeat
from vsacli.compute.rounding import OfRounding

CLOSE, NEWTON_STEPS = 1e-4, 4
"""Length of Newton's step to a torque and a stiffness, as a part of the ranges and for a sine of one, from
which on so many steps leave rounding: it is squared by each."""

LEAST_SINE = OfRounding(1e-8, power=0.5)
"""Sine that is zero; the stiffness then differs from that of the critical point by the square of this."""

LEAST_STIFFNESS = 1e-9
"""Part of the stiffness at the start that is none."""

MAX_STEPS = 400
"""Some 60 do; more only where the level curve winds."""

RESIDUAL = OfRounding(1e-10, power=0.75)
"""Largest error of a solution: of the stiffness; of the torque, as a part of its change over the ranges."""


class Piece(NamedTuple):
    """A point of the piece, and its ends of least and of largest stiffness."""

    seed: Spot
    low: Spot
    high: Spot


class Branch:
    """Solutions that are continued from a start, where q = 0.

    Attributes:
        start: the start, arrays (1,).
        orientation: sign of the sine on the branch.
    """

    def __init__(self, curves: LevelCurves, phi: float, theta_2: float) -> None:
        self._curves = curves
        self._known: tuple[tuple[FloatArray, FloatArray], Piece] | None = None
        with np.errstate(all="ignore"):
            self.start = curves.spot(np.array([phi]), np.array([theta_2]), np.zeros(1))
            self.orientation = float(np.sign(self.start.sine[0]))

    @property
    def stiffest(self) -> Spot:
        """Where the stiffness is largest under the torque of the start, arrays (1,)."""
        with np.errstate(all="ignore"):
            return self._followed(self.start.tau_e, np.zeros(1)).high

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:
        """The reachable stiffness, and phi and theta_2 for the one in it; see `Mechanism.solve`."""
        with np.errstate(all="ignore"):  # trial steps may lead anywhere, and are refused there
            seed, low, high = self._piece(tau_e, q)
            none = low.stiffness <= LEAST_STIFFNESS * self.start.stiffness
            lower = np.where(none, 0.0, low.stiffness)
            inside = (stiffness > lower) & (stiffness < high.stiffness)
            found = self._met(seed, np.where(inside, stiffness, seed.stiffness), tau_e, q)
            failed = inside & ~self._is_met(found, stiffness, tau_e)
            end = high.chosen(stiffness >= high.stiffness, low)
        return PairSolution(
            lower=np.where(failed, np.nan, lower),
            upper=np.where(failed, np.nan, high.stiffness),
            lower_critical=~none & self._is_critical(low),
            upper_critical=self._is_critical(high),
            slack_below=np.zeros_like(failed),
            phi_1=np.where(inside, found.phi, end.phi),
            phi_2=np.where(inside, found.s, end.s),
        )

    def _piece(self, tau_e: FloatArray, q: FloatArray) -> Piece:
        """The pieces at torques and positions; the last ones are kept, since searches ask for them often."""
        if not isinstance(tau_e, np.ndarray):
            return self._followed(tau_e, q)
        known = self._known
        if known is None or not all(map(np.array_equal, known[0], (tau_e, q))):
            self._known = known = (tau_e.copy(), q.copy()), self._followed(tau_e, q)
        return known[1]

    def _followed(self, tau_e: FloatArray, q: FloatArray) -> Piece:
        """The pieces, by walks to both ends, which run side by side."""
        seed, count = self._seed(tau_e, q), len(tau_e)
        both = [np.concatenate((each, each)) for each in (tau_e, q, *seed)]
        side = np.concatenate((np.full_like(tau_e, -1.0), np.ones_like(tau_e)))
        ends = self._walk(Spot(*both[2:]), side, side * np.inf, both[0], both[1])
        return Piece(seed, Spot(*(each[:count] for each in ends)), Spot(*(each[count:] for each in ends)))

    def _seed(self, tau_e: FloatArray, q: FloatArray) -> Spot:
        """A point of the branch at torques and positions, NaN where there is none.

        While these move to their values in proportion, the point moves along the level curve towards where it
        has room on all sides, so that it goes on where the piece becomes short.
        """

        def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
            share, gain, h, *values = state
            spot, (tau_e, q) = Spot(*values), constants
            start = self.start.tau_e + np.zeros_like(tau_e)
            target = np.minimum(share + gain, 1.0)
            reached, stays = self._curves.step(
                spot, np.zeros_like(h), start + target * (tau_e - start), target * q, (target - share) * q
            )
            stays = stays & (self._curves.distance(reached) >= 0)
            spot, share = reached.chosen(stays, spot), np.where(stays, target, share)
            aside, better = self._curves.step(spot, h, start + share * (tau_e - start), share * q)
            better = better & (self._curves.distance(aside) >= 0)
            better = better & (self._curves.room(aside) > self._curves.room(spot))
            h = np.where(better, 1.5 * h, -h / 2)
            h = np.where(np.abs(h) > MAX_STEP, MAX_STEP, h)
            gain = np.where(stays, 2 * gain, gain / 3)
            return (share, gain, h, *aside.chosen(better, spot)), (share == 1) | ~(gain > LEAST_STEP)

        like = np.zeros_like(tau_e)
        begin = (like, like + 0.25, like + 0.02, *(like + each for each in self.start))
        share, _, _, *values = repeat(step, begin, (tau_e, q), MAX_STEPS)
        return Spot(*(np.where(share == 1, each, np.nan) for each in values))

    def _walk(
        self, seed: Spot, direction: FloatArray, goal: FloatArray, tau_e: FloatArray, q: FloatArray
    ) -> Spot:
        """Where the piece ends or meets the goal; direction 1 is that of growing, -1 of falling stiffness."""

        def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
            h, *values = state
            spot, (direction, goal, tau_e, q) = Spot(*values), constants
            reached, stays = self._curves.step(spot, h * direction * self.orientation, tau_e, q)
            here, there = (
                np.minimum(self._curves.distance(each), direction * (goal - each.stiffness) / spot.stiffness)
                for each in (self._curves.onto(spot, tau_e), self._curves.onto(reached, tau_e))
            )
            inside = stays & (there >= 0)
            share = np.where(stays, np.minimum(np.maximum(here / (here - there), 0.02), 0.98), 1 / 3)
            over = ~inside & ((h * share <= LEAST_STEP) | (here <= LEAST_STEP))
            over = over | (length(*spot.to(tau_e, goal)) <= CLOSE * np.abs(spot.sine))
            spot = reached.chosen(inside, spot)
            none = spot.stiffness <= LEAST_STIFFNESS * self.start.stiffness
            h = np.where(inside, np.minimum(1.5 * h, MAX_STEP), h * share)
            return (h, *spot), over | none | ~(spot.sine * self.orientation > LEAST_SINE)

        begin = (np.full_like(tau_e, MAX_STEP / 4), *seed)
        _, *values = repeat(step, begin, (direction, goal, tau_e, q), MAX_STEPS)
        end = self._curves.onto(Spot(*values), tau_e)
        return self._curves.spot(end.phi, end.s, q)

    def _met(self, seed: Spot, demand: FloatArray, tau_e: FloatArray, q: FloatArray) -> Spot:
        """The point of the piece with a stiffness; near it, by Newton's method for torque and stiffness."""
        direction = np.where(demand >= seed.stiffness, 1.0, -1.0)
        spot = self._walk(seed, direction, demand, tau_e, q)
        for _ in range(NEWTON_STEPS):
            step = spot.to(tau_e, demand)
            small = length(*step) <= CONTRACTION * np.abs(spot.sine)
            spot = self._curves.moved(spot, (np.where(small, step[0], 0.0), np.where(small, step[1], 0.0)), q)
        return spot

    def _is_met(self, spot: Spot, demand: FloatArray, tau_e: FloatArray) -> BoolArray:
        met: BoolArray = (np.abs(tau_e - spot.tau_e) <= RESIDUAL * spot.steepness) & (
            np.abs(demand - spot.stiffness) <= RESIDUAL * (self.start.stiffness + demand)
        )
        return met

    def _is_critical(self, spot: Spot) -> BoolArray:
        critical: BoolArray = np.abs(spot.sine) / 10 <= LEAST_SINE
        return critical
