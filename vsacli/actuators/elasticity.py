"""Springs of joints as the equations of motion meet them: at any state of the joints and their motors.

Arrays of joints are (..., joints), those of motors (..., joints, motors), whatever stands before: one
instant, or samples.
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
    """The springs of joints whose actuators are of one kind: a potential of q and theta, and its derivatives.

    Springs are described by phi, one number for each motor, which depends linearly on q and theta. What else
    they depend on belongs to the coordinates that the methods below take.
    """

    def deflections(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Phi from positions, or its rates from velocities: theta - q unless the kind says otherwise."""
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
        """Elastic energy of each joint, J."""

    @abstractmethod
    def state(self, coordinates: FloatArray) -> ElasticState:
        """Return the springs with their derivatives."""


class ElasticState(ABC):
    """The springs of joints at given coordinates: torque and stiffness, and how motions change them."""

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
        """Rate of the elastic torque (17), (..., joints)."""

    @abstractmethod
    def stiffness_rate(self, rates: FloatArray) -> FloatArray:
        """Rate of the stiffness (18), (..., joints)."""

    @abstractmethod
    def stiffness_curvature(self, rates: FloatArray) -> FloatArray:
        """Return the part x' H x' of the second derivative of the stiffness, (..., joints)."""

    @abstractmethod
    def motor_accelerations(
        self, rates: FloatArray, ddq: FloatArray, ddtau_e: FloatArray, ddstiffness: FloatArray
    ) -> FloatArray:
        """Accelerations of the motors that give torque and stiffness these second derivatives, (70)-(72).

        NaN where there are none, because the decoupling matrix is singular.
        """

    def determinant(self) -> FloatArray:
        """Det A (67) over (theta_1, theta_2), zero where A is singular; NaN if no stiffness is commanded."""
        return np.full_like(self.tau_e, np.nan)
