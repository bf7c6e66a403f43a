"""The pairs of springs of several joints, at any state of these."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsacli.actuators.elasticity import Elasticity, ElasticState, Torques
from vsacli.actuators.laws import SpringLaw
from vsacli.actuators.laws.rows import SpringRows
from vsacli.actuators.laws.state import SpringState
from vsacli.actuators.pairs.decoupling_matrix import beta, determinant, solve
from vsacli.base.arrays import FloatArray


class PairElasticity(Elasticity):
    """Two springs at each joint, between either motor and the link; phi are their deflections."""

    def __init__(self, pairs: Sequence[tuple[SpringLaw, SpringLaw]]) -> None:
        self._springs = SpringRows(pairs)

    def torques(self, phi: FloatArray) -> Torques:
        """Each spring pulls the link and its motor alike."""
        tau = self._springs.torque(phi)
        return Torques(tau[..., 0] + tau[..., 1], tau)

    def energy(self, phi: FloatArray) -> FloatArray:
        """The sum over both springs."""
        energy = self._springs.energy(phi)
        return energy[..., 0] + energy[..., 1]

    def state(self, phi: FloatArray) -> ElasticState:
        """Both springs with their derivatives."""
        return _PairStates(self._springs.state(phi))


class _PairStates(ElasticState):
    """Both springs of each joint, arrays (..., joints, 2)."""

    def __init__(self, springs: SpringState) -> None:
        self._springs = springs
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
    def tau_spring(self) -> FloatArray:
        """Torque of each spring."""
        return self._springs.tau

    def torque_rate(self, dphi: FloatArray) -> FloatArray:
        """Sum of sigma_k phi_k'."""
        rates = self._springs.sigma * dphi
        return rates[..., 0] + rates[..., 1]

    def stiffness_rate(self, dphi: FloatArray) -> FloatArray:
        """Sum of zeta_k phi_k'."""
        rates = self._springs.zeta * dphi
        return rates[..., 0] + rates[..., 1]

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
