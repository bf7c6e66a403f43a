"""The springs of a potential of q, theta_1 and theta_2, and how motions change them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from vsacli.actuators.mechanisms.potentials.potential_energy import (
    ACCELERATIONS,
    TORQUES,
    Derivatives,
    PotentialEnergy,
)
from vsacli.actuators.mechanisms.state import DecouplingRows, MechanismState
from vsacli.base.arrays import FloatArray


class PotentialState(MechanismState):
    """The springs of a potential that depends on q, theta_1 and theta_2 in any way.

    With x = (q, theta_1, theta_2) and y = (tau_e, sigma) = (-U_q, U_qq),

        A theta'  = y'  - y_q q'
        A theta'' = y'' - y_q q'' - (x'^T H x' of either), H the second derivatives of y over x.
    """

    def __init__(self, potential: PotentialEnergy, coordinates: FloatArray) -> None:
        self._potential, self._coordinates = potential, coordinates

    @cached_property
    def _first(self) -> Derivatives:
        return self._potential.derivatives(self._coordinates, TORQUES)

    @cached_property
    def _all(self) -> Derivatives:
        return self._potential.derivatives(self._coordinates, ACCELERATIONS)

    @property
    def energy(self) -> FloatArray:
        """U."""
        return self._first()

    @property
    def tau_e(self) -> FloatArray:
        """-U_q."""
        return -self._first(0)

    @property
    def stiffness(self) -> FloatArray:
        """U_qq."""
        return self._all(0, 0)

    @property
    def tau_spring(self) -> FloatArray:
        """Derivatives of U over theta_1 and theta_2."""
        return np.stack((self._first(1), self._first(2)), axis=-1)

    @property
    def rows(self) -> DecouplingRows:
        """Derivatives of tau_e and the stiffness over theta_1 and theta_2."""
        return self._all.rows

    def torque_rate(self, rates: FloatArray) -> FloatArray:
        """Of -U_q."""
        return -self._rate((0,), rates)

    def stiffness_rate(self, rates: FloatArray) -> FloatArray:
        """Of U_qq."""
        return self._rate((0, 0), rates)

    def stiffness_curvature(self, rates: FloatArray) -> FloatArray:
        """Quadratic in the rates of x, of U_qq."""
        return self._curvature((0, 0), rates)

    def spring_rates(self, rates: FloatArray) -> FloatArray:
        """Of the derivatives over theta_1 and theta_2."""
        return np.stack((self._rate((1,), rates), self._rate((2,), rates)), axis=-1)

    def rates(self, dtau_e: FloatArray, dstiffness: FloatArray, dq: FloatArray) -> FloatArray:
        """A^-1 (y' - y_q q'), with phi' = theta_1' - q'."""
        u = self._all
        dtheta_1, dtheta_2 = self.rows.solve(dtau_e + u(0, 0) * dq, dstiffness - u(0, 0, 0) * dq)
        return np.stack((dtheta_1 - dq, dtheta_2, dq), axis=-1)

    def motor_accelerations(
        self, rates: FloatArray, ddq: FloatArray, ddtau_e: FloatArray, ddstiffness: FloatArray
    ) -> FloatArray:
        """A^-1 (y'' - y_q q'' - what is quadratic in the rates)."""
        u = self._all
        torque_row = ddtau_e + u(0, 0) * ddq + self._curvature((0,), rates)
        stiffness_row = ddstiffness - u(0, 0, 0) * ddq - self.stiffness_curvature(rates)
        return np.stack(self.rows.solve(torque_row, stiffness_row), axis=-1)

    def _rate(self, of: tuple[int, ...], rates: FloatArray) -> FloatArray:
        """Rate of a derivative of the potential."""
        return sum((self._all(*of, i) * each for i, each in _motion(rates)), np.zeros_like(rates[..., 0]))

    def _curvature(self, of: tuple[int, ...], rates: FloatArray) -> FloatArray:
        """What is quadratic in the rates in the second time derivative of a derivative of the potential."""
        return sum(
            (self._rate((*of, i), rates) * each for i, each in _motion(rates)), np.zeros_like(rates[..., 0])
        )


def _motion(rates: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    """Rates of q, theta_1 and theta_2 with their numbers, from those of the coordinates."""
    dphi, ds, dq = (rates[..., number] for number in range(3))
    return enumerate((dq, dphi + dq, ds))
