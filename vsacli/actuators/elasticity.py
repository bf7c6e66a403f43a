"""Interface of the springs of joints for the equations of motion: at any state of joints and motors.

Arrays of joints are (..., joints), those of motors (..., joints, motors); the leading axes are free: none for
one instant, or samples.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np

from vsacli.base.arrays import FloatArray

Components: TypeAlias = Sequence[FloatArray] | FloatArray
"""One array for each motor of a joint, or for each coordinate of its springs; all of one shape."""


_Key = TypeVar("_Key")


def indices_of_equals(keys: Sequence[_Key]) -> Iterator[tuple[_Key, list[int]]]:
    """Yield each distinct key, with the indices of those that equal it.

    While parameters are symbols, whose values are unknown, only one and the same object equals itself.
    """
    remaining = list(range(len(keys)))
    while remaining:
        first_key = keys[remaining[0]]
        equal_indices = [index for index in remaining if _is_equal(keys[index], first_key)]
        yield first_key, equal_indices
        remaining = [index for index in remaining if index not in equal_indices]


def _is_equal(key: object, other: object) -> bool:
    with suppress(NotImplementedError):
        return key is other or key == other
    return False


class SpringTorques(NamedTuple):
    """Torques of springs: on the link of each joint (6), and against each motor (62)."""

    tau_e: FloatArray
    tau_transmission: FloatArray


class Elasticity(ABC):
    """Springs of joints with one kind of actuator: a potential of q and theta, and its derivatives.

    The methods take `coordinates`, linear in q and theta: the unknowns of the actuator, such as deflections,
    one per motor, and further variables that the springs depend on.
    """

    def coordinates(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the coordinates, (..., joints, coordinates), or their rates: theta - q by default."""
        return theta - q[..., None]

    def ranged(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the coordinates bounded by `Actuator.phi_ranges`, (..., joints, motors)."""
        return self.coordinates(q, theta)

    @abstractmethod
    def torques(self, coordinates: FloatArray) -> SpringTorques:
        """Return the torques of the springs."""

    @abstractmethod
    def energy(self, coordinates: FloatArray) -> FloatArray:
        """Return the elastic energy of each joint, J."""

    @abstractmethod
    def state(self, coordinates: FloatArray) -> ElasticState:
        """Return the springs with their derivatives."""


class MotorMatrix:
    """A 2x2 matrix over two motors: a row of the torque and one of the stiffness; arrays of one shape.

    The decoupling matrix A = d(tau_e, sigma)/d(theta_1, theta_2) of (67) is one.

    Attributes:
        torque_1, torque_2: Derivatives of the torque by each motor; of a pair of springs sigma_1, sigma_2.
        stiffness_1, stiffness_2: Derivatives of the stiffness; of a pair of springs zeta_1, zeta_2.
        determinant: Determinant (67); zero where the matrix is singular.
    """

    def __init__(
        self, torque_1: FloatArray, torque_2: FloatArray, stiffness_1: FloatArray, stiffness_2: FloatArray
    ) -> None:
        self.torque_1, self.torque_2 = torque_1, torque_2
        self.stiffness_1, self.stiffness_2 = stiffness_1, stiffness_2
        self.determinant: FloatArray = torque_1 * stiffness_2 - torque_2 * stiffness_1

    def solve(self, torque_row: FloatArray, stiffness_row: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the inverse times a right-hand side, as in (68) and (72); NaN where there is none."""
        divisor = np.where(self.determinant == 0, np.nan, self.determinant)
        return (
            (self.stiffness_2 * torque_row - self.torque_2 * stiffness_row) / divisor,
            (self.torque_1 * stiffness_row - self.stiffness_1 * torque_row) / divisor,
        )


class ElasticState(ABC):
    """Springs of joints at given coordinates: torque and stiffness, and their rates for given motions.

    Values of a joint are arrays of any one shape, those of motors and coordinates sequences of such arrays.
    """

    @property
    @abstractmethod
    def energy(self) -> FloatArray:
        """Elastic energy, J."""

    @property
    @abstractmethod
    def tau_e(self) -> FloatArray:
        """Elastic torque (6)."""

    @property
    @abstractmethod
    def stiffness(self) -> FloatArray:
        """Stiffness of the joint (11)."""

    @property
    @abstractmethod
    def tau_transmission(self) -> tuple[FloatArray, ...]:
        """Torque against each motor (62)."""

    @property
    def matrix(self) -> MotorMatrix:
        """The decoupling matrix A of two motors."""
        raise NotImplementedError(f"{type(self).__name__} has one motor")

    @property
    def determinant(self) -> FloatArray:
        """Det A (67); NaN of one motor."""
        return self.matrix.determinant

    def sizes(self, unknowns: Components) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Return the sizes of tau_e and stiffness, relative to which the self-check's errors are.

        They are sums of absolute values of terms; the one of the stiffness is what a relative change of the
        unknowns, such as rounding, changes.
        """
        return np.abs(self.tau_e), self.stiffness

    @abstractmethod
    def torque_rate(self, rates: Components) -> FloatArray:
        """Return the rate of the elastic torque (17) from the rates of the coordinates."""

    @abstractmethod
    def stiffness_rate(self, rates: Components) -> FloatArray:
        """Return the rate of the stiffness (18)."""

    @abstractmethod
    def stiffness_curvature(self, rates: Components) -> FloatArray:
        """Return the part x' H x' of the second derivative of the stiffness."""

    @abstractmethod
    def transmission_rates(self, rates: Components) -> tuple[FloatArray, ...]:
        """Return the rates of the torques against the motors."""

    @abstractmethod
    def rates(self, dtau_e: FloatArray, dstiffness: FloatArray, dq: FloatArray) -> tuple[FloatArray, ...]:
        """Return the rates of the coordinates for rates of torque and stiffness, (68); NaN as below.

        The velocity dq of the joint counts for springs that depend on q, which those of pairs do not.
        """

    @abstractmethod
    def motor_accelerations(
        self, rates: Components, ddq: FloatArray, ddtau_e: FloatArray, ddstiffness: FloatArray
    ) -> tuple[FloatArray, ...]:
        """Return the motor accelerations for these second derivatives of torque and stiffness, (70)-(72).

        NaN where there are none, because the decoupling matrix is singular.
        """
