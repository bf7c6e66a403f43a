"""One spring at each of several joints, for the equations of motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsacli.actuators.elasticity import Elasticity, ElasticState, Torques
from vsacli.actuators.laws.law import SpringRows, SpringState
from vsacli.base.arrays import FloatArray


class LinearRows:
    """Linear springs, one at each joint, evaluated together; otherwise as `SpringRows`."""

    def __init__(self, stiffness: Sequence[float]) -> None:
        self._stiffness = np.array(stiffness)[:, None]

    def torque(self, phi: FloatArray) -> FloatArray:
        """Return K phi."""
        torque: FloatArray = phi * self._stiffness
        return torque

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the energy of the spring."""
        energy: FloatArray = phi * phi * (self._stiffness / 2)
        return energy

    def state(self, phi: FloatArray) -> SpringState:
        """Return the state of a spring of torque K phi."""
        torque, none = self.torque(phi), np.zeros_like(phi)
        return SpringState(torque, np.broadcast_to(self._stiffness, torque.shape), none, none)


class SingleSprings(Elasticity):
    """One spring at each joint."""

    def __init__(self, rows: SpringRows | LinearRows) -> None:
        self._rows = rows

    def torques(self, phi: FloatArray) -> Torques:
        """Return the torques; the spring exerts the same torque on the link as against its motor."""
        tau = self._rows.torque(phi)
        return Torques(tau[..., 0], tau)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the energy of the spring."""
        return self._rows.energy(phi)[..., 0]

    def state(self, phi: FloatArray) -> ElasticState:
        """Return the spring with its derivatives."""
        return _State(self._rows.state(phi))


class _State(ElasticState):
    """One spring of each joint, arrays (..., joints, 1)."""

    def __init__(self, springs: SpringState) -> None:
        self._springs = springs
        self._one = SpringState(*(each[..., 0] for each in springs))

    @property
    def tau_e(self) -> FloatArray:
        """Torque of the spring."""
        return self._one.tau

    @property
    def stiffness(self) -> FloatArray:
        """Stiffness of the spring."""
        return self._one.sigma

    @property
    def tau_transmission(self) -> FloatArray:
        """Torque of the spring."""
        return self._springs.tau

    def torque_rate(self, dphi: FloatArray) -> FloatArray:
        """Return sigma phi'."""
        return self._one.sigma * dphi[..., 0]

    def stiffness_rate(self, dphi: FloatArray) -> FloatArray:
        """Return zeta phi'; for a linear spring zero, not -0."""
        return self._one.zeta * dphi[..., 0] + 0.0

    def stiffness_curvature(self, dphi: FloatArray) -> FloatArray:
        """Return eta phi'^2."""
        return self._one.eta * dphi[..., 0] * dphi[..., 0]

    def motor_accelerations(
        self, dphi: FloatArray, ddq: FloatArray, ddtau_e: FloatArray, _ddstiffness: FloatArray
    ) -> FloatArray:
        """Return (tau_e'' - zeta phi'^2)/sigma + q'', (70) alone."""
        squared = dphi[..., 0] * dphi[..., 0]
        divisor = np.where(self.stiffness == 0, np.nan, self.stiffness)
        return ((ddtau_e - self._one.zeta * squared) / divisor + ddq)[..., None]
