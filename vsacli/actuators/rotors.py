"""Rotors of motors: the inertia B in (73)-(74), with the coupling of motors that ride on one another."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.base.arrays import BoolArray, FloatArray


def largest_coupling(first: float, second: float) -> float:
    """Return what the size of a coupled inertia must be below, or B is not positive definite.

    Args:
        first: inertia of one rotor, on the same side of its gear as the coupled one.
        second: that of the other.
    """
    return math.sqrt(first * second)


class Rotors:
    """Rotors of all motors with springs in a row, joint by joint; arrays (..., motors).

    Where motor 2 is carried around by motor 1, both feel either acceleration: B is a symmetric 2x2 matrix.
    """

    def __init__(self, actuators: Sequence[Actuator]) -> None:
        motors = [
            (motor.inertia, each.coupled_rotors, 1 - 2 * side)
            for each in actuators
            for side, motor in enumerate(each.motors)
        ]
        self._inertia, self._coupling, to_other = np.array(motors).reshape(-1, 3).T
        self._coupled = np.flatnonzero(self._coupling)
        self._other = self._coupled + to_other[self._coupled].astype(np.intp)

    def torques(self, ddtheta: FloatArray) -> FloatArray:
        """B theta''."""
        torques: FloatArray = self._inertia * ddtheta
        if self._coupled.size:
            torques[..., self._coupled] += self._coupling[self._coupled] * ddtheta[..., self._other]
        return torques

    def accelerations(self, torques: FloatArray) -> FloatArray:
        """Theta'' = B^-1 of what is left of the motors' torques."""
        accelerations: FloatArray = torques / self._inertia
        if self._coupled.size:
            here, other = self._coupled, self._other
            share = self._coupling[here] / self._inertia[other]
            effective = self._inertia[here] - share * self._coupling[here]
            accelerations[..., here] = (torques[..., here] - share * torques[..., other]) / effective
        return accelerations

    def held(self, torques: FloatArray, held: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Theta'' where some motors are held, and the torques that hold these, 0 of others; (..., motors)."""
        apart = held.copy()
        apart[..., self._coupled] |= held[..., self._other]
        moving = np.where(apart, torques / self._inertia, self.accelerations(torques))
        accelerations = np.where(held, 0.0, moving)
        return accelerations, np.where(held, torques - self.torques(accelerations), 0.0)
