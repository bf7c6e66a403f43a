"""Interface of the springs of joints for the equations of motion: at any state of joints and motors.

Arrays of joints are (..., joints), those of motors (..., joints, motors); the leading axes are free: none for
one instant, or samples.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray


class Torques(NamedTuple):
    """Torques of springs: on the link of each joint (6), and against each motor (62)."""

    tau_e: FloatArray
    tau_transmission: FloatArray


class Elasticity(ABC):
    """Springs of joints with one kind of actuator: a potential of q and theta, and its derivatives.

    The state of the springs is phi, one coordinate per motor, linear in q and theta. The methods below take
    `coordinates`: phi, and further variables that the springs depend on.
    """

    def deflections(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return phi from positions, or its rates from velocities; theta - q unless the kind overrides it."""
        return theta - q[..., None]

    def ranged(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the coordinates bounded by `Actuator.phi_ranges`, (..., joints, motors): phi by default."""
        return self.deflections(q, theta)

    def coordinates(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the coordinates of the springs, (..., joints, coordinates), or rates: phi by default."""
        return self.deflections(q, theta)

    @abstractmethod
    def torques(self, coordinates: FloatArray) -> Torques:
        """Return the torques of the springs."""

    @abstractmethod
    def energy(self, coordinates: FloatArray) -> FloatArray:
        """Return the elastic energy of each joint, J."""

    @abstractmethod
    def state(self, coordinates: FloatArray) -> ElasticState:
        """Return the springs with their derivatives."""


class ElasticState(ABC):
    """Springs of joints at given coordinates: torque and stiffness, and their rates for given motions."""

    @property
    @abstractmethod
    def tau_e(self) -> FloatArray:
        """Elastic torque (6), (..., joints)."""

    @property
    @abstractmethod
    def stiffness(self) -> FloatArray:
        """Stiffness of the joint (11), (..., joints)."""

    @property
    @abstractmethod
    def tau_transmission(self) -> FloatArray:
        """Torque against each motor (62), (..., joints, motors)."""

    @abstractmethod
    def torque_rate(self, rates: FloatArray) -> FloatArray:
        """Return the rate of the elastic torque (17), (..., joints)."""

    @abstractmethod
    def stiffness_rate(self, rates: FloatArray) -> FloatArray:
        """Return the rate of the stiffness (18), (..., joints)."""

    @abstractmethod
    def stiffness_curvature(self, rates: FloatArray) -> FloatArray:
        """Return the part x' H x' of the second derivative of the stiffness, (..., joints)."""

    @abstractmethod
    def motor_accelerations(
        self, rates: FloatArray, ddq: FloatArray, ddtau_e: FloatArray, ddstiffness: FloatArray
    ) -> FloatArray:
        """Return the motor accelerations for these second derivatives of torque and stiffness, (70)-(72).

        NaN where there are none, because the decoupling matrix is singular.
        """

    def determinant(self) -> FloatArray:
        """Return det A (67) over (theta_1, theta_2), zero where A is singular; NaN if not overridden."""
        return np.full_like(self.tau_e, np.nan)
