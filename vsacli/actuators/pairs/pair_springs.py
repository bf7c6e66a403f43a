"""Pairs of springs in motion: torque, stiffness, decoupling matrix A and motor accelerations, (62)-(72)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial

import numpy as np

from vsacli.actuators.elasticity import Components, Elasticity, ElasticState, MotorMatrix, SpringTorques
from vsacli.actuators.laws.law import SpringLaw, SpringRows, SpringState
from vsacli.base.arrays import FloatArray


class PairSprings(ElasticState):
    """State of two springs, each between a motor and the link; the coordinates are their deflections.

    Args:
        spring_1: State of spring 1 (62)-(64), (66).
        spring_2: State of spring 2.
        energy: Function that returns the energy of all springs, which few callers need.
        coupling: Function that returns the torque of a spring between the motors and its derivatives up to an
            order, if there is one.
    """

    def __init__(
        self,
        spring_1: SpringState,
        spring_2: SpringState,
        energy: Callable[[], FloatArray],
        coupling: Callable[[int], Sequence[FloatArray]] | None,
    ) -> None:
        self._spring_1, self._spring_2, self._energy, self._coupling = spring_1, spring_2, energy, coupling

    @property
    def energy(self) -> FloatArray:
        """Energy of all springs."""
        return self._energy()

    @property
    def tau_e(self) -> FloatArray:
        """Sum of the torques of both springs; a coupling exerts none on the link."""
        return self._spring_1.tau + self._spring_2.tau

    @property
    def stiffness(self) -> FloatArray:
        """Sum of both stiffnesses."""
        return self._spring_1.sigma + self._spring_2.sigma

    @property
    def tau_transmission(self) -> tuple[FloatArray, FloatArray]:
        """Torque of each spring, and of the coupling, which acts on the motors in opposite directions."""
        if self._coupling is None:
            return self._spring_1.tau, self._spring_2.tau
        (coupling_torque,) = self._coupling(0)
        return self._spring_1.tau + coupling_torque, self._spring_2.tau - coupling_torque

    @cached_property
    def matrix(self) -> MotorMatrix:
        """The matrix A: stiffness and slope of each spring."""
        return MotorMatrix(
            self._spring_1.sigma, self._spring_2.sigma, self._spring_1.zeta, self._spring_2.zeta
        )

    def sizes(self, _unknowns: Components) -> tuple[FloatArray, FloatArray]:
        """Return the sum of the sizes of both torques, and the stiffness."""
        return np.abs(self._spring_1.tau) + np.abs(self._spring_2.tau), self.stiffness

    def torque_rate(self, rates: Components) -> FloatArray:
        """Return the sum of sigma_k phi_k' (17)."""
        return self._spring_1.sigma * rates[0] + self._spring_2.sigma * rates[1]

    def stiffness_rate(self, rates: Components) -> FloatArray:
        """Return the sum of zeta_k phi_k' (18)."""
        return self._spring_1.zeta * rates[0] + self._spring_2.zeta * rates[1]

    def stiffness_curvature(self, rates: Components) -> FloatArray:
        """Return the sum of eta_k phi_k'^2, of (22)."""
        return self._spring_1.eta * (rates[0] * rates[0]) + self._spring_2.eta * (rates[1] * rates[1])

    def transmission_rates(self, rates: Components) -> tuple[FloatArray, FloatArray]:
        """Return sigma_k phi_k' of each side, with the rate of the coupling."""
        rate_1, rate_2 = self._spring_1.sigma * rates[0], self._spring_2.sigma * rates[1]
        if self._coupling is None:
            return rate_1, rate_2
        coupling_rate = self._coupling(1)[1] * (rates[0] - rates[1])
        return rate_1 + coupling_rate, rate_2 - coupling_rate

    def rates(self, dtau_e: FloatArray, dstiffness: FloatArray, _dq: FloatArray) -> tuple[FloatArray, ...]:
        """Return A^-1 (tau_e', sigma'), (68)."""
        return self.matrix.solve(dtau_e, dstiffness)

    def motor_accelerations(
        self, rates: Components, ddq: FloatArray, ddtau_e: FloatArray, ddstiffness: FloatArray
    ) -> tuple[FloatArray, ...]:
        """Return A^-1 beta (72), with the sums (11) and (65)."""
        spring_1, spring_2 = self._spring_1, self._spring_2
        torque_curvature = spring_1.zeta * (rates[0] * rates[0]) + spring_2.zeta * (rates[1] * rates[1])
        return self.matrix.solve(
            ddtau_e - torque_curvature + self.stiffness * ddq,  # (70)
            ddstiffness - self.stiffness_curvature(rates) + (spring_1.zeta + spring_2.zeta) * ddq,  # (71)
        )


class PairElasticity(Elasticity):
    """Two springs at each of several joints, and a coupling that is equal at all of them, if there is one."""

    def __init__(self, pairs: Sequence[tuple[SpringLaw, SpringLaw]], coupling: SpringLaw | None) -> None:
        self._springs, self._coupling = SpringRows(pairs), coupling

    def torques(self, phi: FloatArray) -> SpringTorques:
        """Return the torques; each spring exerts the same torque on the link as against its motor."""
        tau = self._springs.torque(phi)
        tau_e = tau[..., 0] + tau[..., 1]
        if self._coupling is None:
            return SpringTorques(tau_e, tau)
        coupling_torque = self._coupling.torque(phi[..., 0] - phi[..., 1])
        return SpringTorques(tau_e, tau + np.stack((coupling_torque, -coupling_torque), axis=-1))

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the sum over all springs."""
        spring_energies = self._springs.energy(phi)
        energy = spring_energies[..., 0] + spring_energies[..., 1]
        return energy if self._coupling is None else energy + self._coupling.energy(phi[..., 0] - phi[..., 1])

    def state(self, phi: FloatArray) -> ElasticState:
        """Return the springs with their derivatives."""
        springs = self._springs.state(phi)
        spring_1, spring_2 = (SpringState(*(values[..., side] for values in springs)) for side in range(2))
        law, coupling_deflection = self._coupling, phi[..., 0] - phi[..., 1]
        coupling = None if law is None else partial(law.derivatives, coupling_deflection)
        return PairSprings(spring_1, spring_2, partial(self.energy, phi), coupling)
