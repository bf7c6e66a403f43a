"""Single springs in motion: one spring at a joint, or at each of several joints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from vsacli.actuators.elasticity import Components, Elasticity, ElasticState, SpringTorques
from vsacli.actuators.laws.law import SpringRows, SpringState
from vsacli.base.arrays import FloatArray


class SingleSpring(ElasticState):
    """State of a spring between the motor and the link; the coordinate is its deflection.

    Args:
        spring: State of the spring.
        energy: Function that returns its energy, which few callers need.
    """

    def __init__(self, spring: SpringState, energy: Callable[[], FloatArray]) -> None:
        self._spring, self._energy = spring, energy

    @property
    def energy(self) -> FloatArray:
        """Energy of the spring."""
        return self._energy()

    @property
    def tau_e(self) -> FloatArray:
        """Torque of the spring."""
        return self._spring.tau

    @property
    def stiffness(self) -> FloatArray:
        """Stiffness of the spring."""
        return self._spring.sigma

    @property
    def tau_transmission(self) -> tuple[FloatArray]:
        """Torque of the spring."""
        return (self._spring.tau,)

    @property
    def determinant(self) -> FloatArray:
        """NaN: there is no matrix A."""
        return np.full_like(self.tau_e, np.nan)

    def torque_rate(self, rates: Components) -> FloatArray:
        """Return sigma phi'."""
        return self._spring.sigma * rates[0]

    def stiffness_rate(self, rates: Components) -> FloatArray:
        """Return zeta phi'; for a linear spring zero, not -0."""
        return self._spring.zeta * rates[0] + 0.0

    def stiffness_curvature(self, rates: Components) -> FloatArray:
        """Return eta phi'^2."""
        return self._spring.eta * rates[0] * rates[0]

    def transmission_rates(self, rates: Components) -> tuple[FloatArray]:
        """Return sigma phi'."""
        return (self.torque_rate(rates),)

    def rates(self, dtau_e: FloatArray, _dstiffness: FloatArray, _dq: FloatArray) -> tuple[FloatArray]:
        """Return tau_e'/sigma; NaN where sigma is zero."""
        return (dtau_e / self._nonzero_stiffness,)

    def motor_accelerations(
        self, rates: Components, ddq: FloatArray, ddtau_e: FloatArray, _ddstiffness: FloatArray
    ) -> tuple[FloatArray]:
        """Return (tau_e'' - zeta phi'^2)/sigma + q'', (70) alone."""
        return ((ddtau_e - self._spring.zeta * rates[0] * rates[0]) / self._nonzero_stiffness + ddq,)

    @property
    def _nonzero_stiffness(self) -> FloatArray:
        return np.where(self.stiffness == 0, np.nan, self.stiffness)


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
        return phi * phi * (self._stiffness / 2)

    def state(self, phi: FloatArray) -> SpringState:
        """Return the state of a spring of torque K phi."""
        torque, zero = self.torque(phi), np.zeros_like(phi)
        return SpringState(torque, np.broadcast_to(self._stiffness, torque.shape), zero, zero)


class SingleSprings(Elasticity):
    """One spring at each joint."""

    def __init__(self, rows: SpringRows | LinearRows) -> None:
        self._rows = rows

    def torques(self, phi: FloatArray) -> SpringTorques:
        """Return the torques; the spring exerts the same torque on the link as against its motor."""
        tau = self._rows.torque(phi)
        return SpringTorques(tau[..., 0], tau)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the energy of the spring."""
        return self._rows.energy(phi)[..., 0]

    def state(self, phi: FloatArray) -> ElasticState:
        """Return the spring with its derivatives."""
        spring = SpringState(*(values[..., 0] for values in self._rows.state(phi)))
        return SingleSpring(spring, partial(self.energy, phi))
