"""Level curves of the torque of a potential, and steps along them that stay on one piece.

At a given torque and position of the joint, the points (phi, theta_2) with that torque form a level curve.
Along it the stiffness changes with the sine of the angle between the gradients of torque and stiffness, whose
zeros are those of det A; so it is monotone on the piece between two of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.mechanisms.potentials.potential_energy import ROWS, PotentialEnergy
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.rounding import OfRounding

# With the bounds below no step left its branch on any of 4,000 level curves of 100 random potentials, of the
# kind that tests/actuators/test_potential_mechanism.py draws.

MAX_STEP = 0.1
"""Longest step, as a part of the ranges."""

LEAST_STEP = OfRounding(1e-13, power=0.9)
"""Length at which a step is none."""

LEAST_COSINE = 0.95
"""Of the angle by which the level curve may turn in a step."""

LEAST_SHARE = 0.25
"""Part of the stiffness, and of the sine, that a step must leave; so it passes no zero."""

SHORT = 1e-3
"""Step, as a part of the ranges, in which the stiffness is not looked at; of the motion from the start it is
none along the level curve."""

MOST_UNEXPLAINED = 0.1
"""Part of the change of stiffness that its slopes at both ends of a step need not explain; where the slope
changes its sign twice in between, they explain little."""

LEVEL_ERROR = OfRounding(1e-5, power=0.25)
"""Distance from the level curve, as a part of the ranges, that the next step makes up for."""

CONTRACTION = 0.1
"""Part of a correction of Newton's method that the next one may be, for the method to converge."""


class Spot(NamedTuple):
    """A point (phi, theta_2); arrays (samples,).

    Attributes:
        phi: deflection.
        s: theta_2.
        tau_e: elastic torque.
        stiffness: of the joint.
        torque_1: change of the torque with phi, over the range of phi.
        torque_2: the same with theta_2.
        stiffness_1: change of the stiffness with phi, over the range of phi.
        stiffness_2: the same with theta_2.
    """

    phi: FloatArray
    s: FloatArray
    tau_e: FloatArray
    stiffness: FloatArray
    torque_1: FloatArray
    torque_2: FloatArray
    stiffness_1: FloatArray
    stiffness_2: FloatArray

    @property
    def steepness(self) -> FloatArray:
        """Length of the torque's gradient."""
        return length(self.torque_1, self.torque_2)

    @property
    def sine(self) -> FloatArray:
        """Of the angle from the torque's gradient to that of the stiffness: zero where A is singular."""
        determinant = self.torque_1 * self.stiffness_2 - self.torque_2 * self.stiffness_1
        return determinant / (self.steepness * length(self.stiffness_1, self.stiffness_2))

    @property
    def slope(self) -> FloatArray:
        """Of the stiffness along the level curve."""
        return (self.torque_1 * self.stiffness_2 - self.torque_2 * self.stiffness_1) / self.steepness

    @property
    def along(self) -> tuple[FloatArray, FloatArray]:
        """Direction of the level curve, as a part of the ranges; the stiffness grows with the sine."""
        return -self.torque_2 / self.steepness, self.torque_1 / self.steepness

    def to(self, tau_e: FloatArray, stiffness: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Newton's step to a torque and a stiffness, as a part of the ranges."""
        missing = tau_e - self.tau_e, stiffness - self.stiffness
        determinant = self.torque_1 * self.stiffness_2 - self.torque_2 * self.stiffness_1
        return (
            (self.stiffness_2 * missing[0] - self.torque_2 * missing[1]) / determinant,
            (self.torque_1 * missing[1] - self.stiffness_1 * missing[0]) / determinant,
        )

    def chosen(self, mask: BoolArray, other: Spot) -> Spot:
        """This one where the mask holds, else the other."""
        return Spot(*(np.where(mask, *pair) for pair in zip(self, other, strict=True)))


def length(a: FloatArray, b: FloatArray) -> FloatArray:
    """Of a vector; `numpy.hypot` takes ten times as long to spare numbers that no joint has."""
    return np.sqrt(a * a + b * b)


class LevelCurves:
    """The level curves of a potential within ranges.

    Args:
        potential: the potential.
        phi: range of the deflection.
        theta_2: range of motor 2.
    """

    def __init__(
        self, potential: PotentialEnergy, phi: tuple[float, float], theta_2: tuple[float, float]
    ) -> None:
        self._potential = potential
        self._low = phi[0], theta_2[0]
        self._width = phi[1] - phi[0], theta_2[1] - theta_2[0]

    def spot(self, phi: FloatArray, s: FloatArray, q: FloatArray) -> Spot:
        """The point at a deflection, a position of motor 2 and one of the joint."""
        u = self._potential.derivatives(np.stack((phi, s, q), axis=-1), ROWS)
        rows, (by_phi, by_s) = u.rows, self._width
        return Spot(
            phi,
            s,
            -u(0),
            u(0, 0),
            rows.torque_1 * by_phi,
            rows.torque_2 * by_s,
            rows.stiffness_1 * by_phi,
            rows.stiffness_2 * by_s,
        )

    def moved(self, spot: Spot, step: tuple[FloatArray, FloatArray], q: FloatArray) -> Spot:
        """A point moved by a part of the ranges."""
        return self.spot(spot.phi + self._width[0] * step[0], spot.s + self._width[1] * step[1], q)

    def onto(self, spot: Spot, tau_e: FloatArray) -> Spot:
        """Where the level curve of a torque close by is, and the stiffness there, to first order."""
        share = (tau_e - spot.tau_e) / (spot.steepness * spot.steepness)
        by_torque = spot.stiffness_1 * spot.torque_1 + spot.stiffness_2 * spot.torque_2
        return spot._replace(
            phi=spot.phi + self._width[0] * spot.torque_1 * share,
            s=spot.s + self._width[1] * spot.torque_2 * share,
            stiffness=spot.stiffness + by_torque * share,
        )

    def distance(self, spot: Spot) -> FloatArray:
        """To the nearest end of a range, as a part of it; negative outside."""
        phi, s = (
            (value - low) / width for value, low, width in zip(spot[:2], self._low, self._width, strict=True)
        )
        return np.minimum(np.minimum(phi, 1 - phi), np.minimum(s, 1 - s))

    def room(self, spot: Spot) -> FloatArray:
        """How far a point is from all ends of the piece."""
        room: FloatArray = np.abs(spot.sine) * spot.stiffness
        for value, low, width in zip(spot[:2], self._low, self._width, strict=True):
            part = (value - low) / width
            room = room * part * (1 - part)
        return room

    def step(
        self, spot: Spot, h: FloatArray, tau_e: FloatArray, q: FloatArray, dq: FloatArray | float = 0.0
    ) -> tuple[Spot, BoolArray]:
        """A step of length h along a level curve and onto that of tau_e, and whether it stays on the piece.

        Args:
            spot: where to begin.
            h: length, as a part of the ranges; the stiffness grows with it if the sine is positive.
            tau_e: torque wanted.
            q: position of the joint.
            dq: how far that is from the position at which the spot was found.
        """
        first, second = spot.along
        by_q = spot.torque_1 / self._width[0] - spot.stiffness  # of the torque, at constant phi and theta_2
        onto = (tau_e - spot.tau_e - by_q * dq) / (spot.steepness * spot.steepness)
        step = h * first + onto * spot.torque_1, h * second + onto * spot.torque_2
        predicted = self.moved(spot, step, q)
        onto = (tau_e - predicted.tau_e) / (predicted.steepness * predicted.steepness)
        correction = onto * predicted.torque_1, onto * predicted.torque_2
        reached = self.moved(spot, (step[0] + correction[0], step[1] + correction[1]), q)
        size, left = length(*correction), np.abs(tau_e - reached.tau_e) / reached.steepness
        explained = h * (spot.slope + reached.slope) / 2
        change = self.onto(reached, tau_e).stiffness - self.onto(spot, tau_e).stiffness
        turned = first * reached.along[0] + second * reached.along[1]
        stays = (
            (length(step[0], step[1]) + size <= 2 * MAX_STEP)
            & (left <= np.minimum(CONTRACTION * size + LEAST_STEP, LEVEL_ERROR))
            & (turned >= LEAST_COSINE)
            & ((np.abs(h) < SHORT) | (np.abs(change - explained) <= MOST_UNEXPLAINED * np.abs(explained)))
            & (reached.stiffness >= LEAST_SHARE * spot.stiffness)
            & (reached.sine / spot.sine >= LEAST_SHARE)
        )
        return reached, stays
