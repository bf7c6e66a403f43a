"""The decoupling matrix A of a pair of springs, (67)-(68) and (70)-(72), and the pairs of several joints.

The inverse dynamics uses the functions; forward dynamics and controllers use the classes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsacli.actuators.elasticity import Elasticity, ElasticState, Torques
from vsacli.actuators.laws.law import SpringLaw, SpringRows, SpringState
from vsacli.base.arrays import FloatArray

Sides = tuple[FloatArray, FloatArray]
"""A quantity of sides 1 and 2, each a motor with its spring."""


def determinant(one: SpringState, two: SpringState) -> FloatArray:
    """Return det A (67); zero where A is singular."""
    return one.sigma * two.zeta - two.sigma * one.zeta


def solve_decoupling(
    one: SpringState, two: SpringState, divisor: FloatArray, torque_row: FloatArray, stiffness_row: FloatArray
) -> Sides:
    """Return A^-1 times a right-hand side, as in (68) and (72).

    Args:
        one: State of spring 1.
        two: State of spring 2.
        divisor: Det A, or NaN where the result is to be NaN.
        torque_row: Right-hand side of the first row of A, (17) or (21).
        stiffness_row: Right-hand side of the second row, (18) or (22).
    """
    return (
        (two.zeta * torque_row - two.sigma * stiffness_row) / divisor,
        (one.sigma * stiffness_row - one.zeta * torque_row) / divisor,
    )


def beta(
    one: SpringState,
    two: SpringState,
    dphi: Sides,
    ddtau_e: FloatArray,
    ddstiffness: FloatArray,
    ddq: FloatArray,
) -> Sides:
    """Return the right-hand side of (72), with the sums (11) and (65)."""
    squared_1, squared_2 = dphi[0] * dphi[0], dphi[1] * dphi[1]
    return (
        ddtau_e - (one.zeta * squared_1 + two.zeta * squared_2) + (one.sigma + two.sigma) * ddq,  # (70)
        ddstiffness - (one.eta * squared_1 + two.eta * squared_2) + (one.zeta + two.zeta) * ddq,  # (71)
    )


class PairElasticity(Elasticity):
    """Two springs at each joint, each between a motor and the link; phi are their deflections."""

    def __init__(self, pairs: Sequence[tuple[SpringLaw, SpringLaw]]) -> None:
        self._springs = SpringRows(pairs)

    def torques(self, phi: FloatArray) -> Torques:
        """Return the torques; each spring exerts the same torque on the link as against its motor."""
        tau = self._springs.torque(phi)
        return Torques(tau[..., 0] + tau[..., 1], tau)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the sum over both springs."""
        energy = self._springs.energy(phi)
        return energy[..., 0] + energy[..., 1]

    def state(self, phi: FloatArray) -> ElasticState:
        """Return both springs with their derivatives."""
        return _PairStates(self._springs.state(phi))


class CoupledPairs(PairElasticity):
    """Pairs with a third spring, between the motors of each joint, whose deflection is theta_1 - theta_2."""

    def __init__(self, pairs: Sequence[tuple[SpringLaw, SpringLaw]], coupling: SpringLaw) -> None:
        super().__init__(pairs)
        self._coupling = coupling

    def torques(self, phi: FloatArray) -> Torques:
        """Return the torques with those of the coupling, which act on the motors in opposite directions."""
        tau_e, tau_transmission = super().torques(phi)
        return Torques(tau_e, tau_transmission + self._between(phi))

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the sum over all three springs."""
        return super().energy(phi) + self._coupling.energy(phi[..., 0] - phi[..., 1])

    def state(self, phi: FloatArray) -> ElasticState:
        """Return both springs with their derivatives, and the torques of the coupling."""
        return _PairStates(self._springs.state(phi), self._between(phi))

    def _between(self, phi: FloatArray) -> FloatArray:
        """Return the torque of the coupling against each motor."""
        torque = self._coupling.torque(phi[..., 0] - phi[..., 1])
        return np.stack((torque, -torque), axis=-1)


class _PairStates(ElasticState):
    """States of both springs of each joint, (..., joints, 2), and coupling torques against the motors."""

    def __init__(self, springs: SpringState, coupling: FloatArray | None = None) -> None:
        self._springs, self._coupling = springs, coupling
        self._one, self._two = (SpringState(*(each[..., side] for each in springs)) for side in range(2))

    @property
    def tau_e(self) -> FloatArray:
        """Sum of both torques."""
        return self._one.tau + self._two.tau

    @property
    def stiffness(self) -> FloatArray:
        """Sum of both stiffnesses."""
        return self._one.sigma + self._two.sigma

    @property
    def tau_transmission(self) -> FloatArray:
        """Torque of each spring, and of the coupling."""
        return self._springs.tau if self._coupling is None else self._springs.tau + self._coupling

    def torque_rate(self, dphi: FloatArray) -> FloatArray:
        """Return the sum of sigma_k phi_k' (17)."""
        rates = self._springs.sigma * dphi
        return rates[..., 0] + rates[..., 1]

    def stiffness_rate(self, dphi: FloatArray) -> FloatArray:
        """Return the sum of zeta_k phi_k' (18)."""
        rates = self._springs.zeta * dphi
        return rates[..., 0] + rates[..., 1]

    def stiffness_curvature(self, dphi: FloatArray) -> FloatArray:
        """Return the sum of eta_k phi_k'^2, of (22)."""
        bent = self._springs.eta * dphi * dphi
        return bent[..., 0] + bent[..., 1]

    def motor_accelerations(
        self, dphi: FloatArray, ddq: FloatArray, ddtau_e: FloatArray, ddstiffness: FloatArray
    ) -> FloatArray:
        """Return A^-1 beta, (70)-(72)."""
        det_a = self.determinant()
        divisor = np.where(det_a == 0, np.nan, det_a)
        sides = dphi[..., 0], dphi[..., 1]
        right = beta(self._one, self._two, sides, ddtau_e, ddstiffness, ddq)
        ddtheta = np.empty_like(dphi)
        ddtheta[..., 0], ddtheta[..., 1] = solve_decoupling(self._one, self._two, divisor, *right)
        return ddtheta

    def determinant(self) -> FloatArray:
        """Return det A (67)."""
        return determinant(self._one, self._two)
