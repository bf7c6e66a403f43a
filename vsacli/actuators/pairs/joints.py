"""Pairs of springs of several joints, with their decoupling matrices A: (67)-(68), (70)-(72)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsacli.actuators.elasticity import Elasticity, ElasticState, Torques
from vsacli.actuators.laws.law import SpringLaw, SpringRows, SpringState
from vsacli.base.arrays import FloatArray

Sides = tuple[FloatArray, FloatArray]
"""A quantity of side 1, its motor or its spring, and of side 2."""


def determinant(one: SpringState, two: SpringState) -> FloatArray:
    """Det A (67); zero where A is singular."""
    return one.sigma * two.zeta - two.sigma * one.zeta


def solve(
    one: SpringState, two: SpringState, divisor: FloatArray, torque_row: FloatArray, stiffness_row: FloatArray
) -> Sides:
    """A^-1 times a right-hand side, as (68) and (72) need.

    The divisor is det A, or NaN where there is no solution.
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
    """Right-hand side of (72), with the sums (11) and (65)."""
    squared_1, squared_2 = dphi[0] * dphi[0], dphi[1] * dphi[1]
    return (
        ddtau_e - (one.zeta * squared_1 + two.zeta * squared_2) + (one.sigma + two.sigma) * ddq,  # (70)
        ddstiffness - (one.eta * squared_1 + two.eta * squared_2) + (one.zeta + two.zeta) * ddq,  # (71)
    )


class PairElasticity(Elasticity):
    """Two springs at each joint, between either motor and the link; phi are their deflections."""

    def __init__(self, pairs: Sequence[tuple[SpringLaw, SpringLaw]]) -> None:
        self._springs = SpringRows(pairs)

    def torques(self, phi: FloatArray) -> Torques:
        """Return the torques: each spring pulls the link and its motor equally."""
        tau = self._springs.torque(phi)
        return Torques(tau[..., 0] + tau[..., 1], tau)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the sum over both springs."""
        energy = self._springs.energy(phi)
        return energy[..., 0] + energy[..., 1]

    def state(self, phi: FloatArray) -> ElasticState:
        """Both springs with their derivatives."""
        return _PairStates(self._springs.state(phi))


class CoupledPairs(PairElasticity):
    """The same with a spring between the motors of each joint, whose deflection is theta_1 - theta_2."""

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
        """Both springs with their derivatives, and what the coupling adds."""
        return _PairStates(self._springs.state(phi), self._between(phi))

    def _between(self, phi: FloatArray) -> FloatArray:
        """Torque of the coupling against each motor."""
        torque = self._coupling.torque(phi[..., 0] - phi[..., 1])
        return np.stack((torque, -torque), axis=-1)


class _PairStates(ElasticState):
    """Both springs of each joint, arrays (..., joints, 2), and what a coupling exerts against the motors."""

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
        """Sum of sigma_k phi_k'."""
        rates = self._springs.sigma * dphi
        return rates[..., 0] + rates[..., 1]

    def stiffness_rate(self, dphi: FloatArray) -> FloatArray:
        """Sum of zeta_k phi_k'."""
        rates = self._springs.zeta * dphi
        return rates[..., 0] + rates[..., 1]

    def stiffness_curvature(self, dphi: FloatArray) -> FloatArray:
        """Sum of eta_k phi_k'^2."""
        bent = self._springs.eta * dphi * dphi
        return bent[..., 0] + bent[..., 1]

    def motor_accelerations(
        self, dphi: FloatArray, ddq: FloatArray, ddtau_e: FloatArray, ddstiffness: FloatArray
    ) -> FloatArray:
        """A^-1 beta, (70)-(72)."""
        det_a = self.determinant()
        divisor = np.where(det_a == 0, np.nan, det_a)
        sides = dphi[..., 0], dphi[..., 1]
        right = beta(self._one, self._two, sides, ddtau_e, ddstiffness, ddq)
        ddtheta = np.empty_like(dphi)
        ddtheta[..., 0], ddtheta[..., 1] = solve(self._one, self._two, divisor, *right)
        return ddtheta

    def determinant(self) -> FloatArray:
        """Det A (67)."""
        return determinant(self._one, self._two)
