"""Dry friction of motors whose speed is uncertain: they reverse earlier or later, or not at all.

Friction whose width is 0 jumps where the speed changes its sign, so that it has no derivative there. While
speed v and torque tau are normally distributed, none is needed: friction is F with the probability
P(v > 0), and -B with P(v < 0). By Stein's lemma (C. M. Stein, Annals of Statistics 9 (1981)) its covariance
with tau is cov(tau, v) times the mean of its derivative, F + B times the density of v at 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.friction import REST, FrictionLaws
from vsacli.base.arrays import BoolArray, FloatArray

NEAR = 5.0
"""Standard deviations of a speed up to which its motor may run the other way. By a normal distribution one in
three million does, but near the ends of corridors speeds grow without bound, and their tails are longer."""


class Reversals:
    """Dry friction of the motors of some joints, of which only the sharp ones count.

    Args:
        actuators: of the joints.
    """

    def __init__(self, actuators: Sequence[Actuator]) -> None:
        sides = [side.friction if side else None for each in actuators for side in each.sides]
        friction = FrictionLaws.of(sides)
        shape = (len(actuators), -1)
        zero = np.zeros(len(sides)).reshape(shape)
        self._forward = self._backward = zero
        if friction is not None:
            self._forward = np.where(friction.sharp, friction.forward, 0.0).reshape(shape)
            self._backward = np.where(friction.sharp, friction.backward, 0.0).reshape(shape)

    @property
    def possible(self) -> bool:
        """Whether any motor has such friction."""
        return bool(np.any(self._forward + self._backward))

    def variance(self, speed: FloatArray, deviation: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return what friction adds to the variance of motor torques; all (samples, joints, 2).

        Args:
            speed: of the motors.
            deviation: its standard deviation.
            covariance: of speed and torque, without such friction.
        """
        from scipy.special import ndtr

        uncertain = deviation > 0
        scale = np.where(uncertain, deviation, 1.0)
        above, below = (speed - REST) / scale, (-speed - REST) / scale
        forward, backward = self._forward, self._backward
        up, down = ndtr(above), ndtr(below)
        spread = forward**2 * up + backward**2 * down - (forward * up - backward * down) ** 2
        slope = (forward * np.exp(-(above**2) / 2) + backward * np.exp(-(below**2) / 2)) / np.sqrt(2 * np.pi)
        return np.where(uncertain, spread + 2 * covariance / scale * slope, 0.0)

    def uncertain(self, speed: FloatArray, deviation: FloatArray) -> BoolArray:
        """Return where the direction of a motor is uncertain, (samples, joints); as of `variance`."""
        near = (deviation > 0) & (np.abs(speed) < NEAR * deviation)
        found: BoolArray = np.any(near & (self._forward + self._backward > 0), axis=-1)
        return found
