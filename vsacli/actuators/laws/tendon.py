"""Springs that only pull: slack at zero deflection, and on side 2 mirrored, where they pull the other way."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.laws.state import SpringState
from vsacli.base.arrays import FloatArray


@dataclass(frozen=True)
class Tendon(SpringLaw):
    """A law for phi >= 0; on side 2 it acts as tau_2(phi) = -tau(-phi) for phi <= 0."""

    @property
    def domain(self) -> tuple[float, float]:
        """Deflections from slack upward."""
        return (0.0, math.inf)

    @property
    def torque_range(self) -> tuple[float, float]:
        """Torques from slack upward."""
        return (0.0, math.inf)

    @property
    def pulls_only(self) -> bool:
        """A tendon cannot push."""
        return True

    def as_second(self) -> SpringLaw:
        """The tendon pulling downward."""
        return Mirrored(law=self)


@dataclass(frozen=True)
class Mirrored(SpringLaw):
    """A law reflected in the origin, tau(phi) = -law.tau(-phi)."""

    law: SpringLaw = field(kw_only=True)

    @property
    def domain(self) -> tuple[float, float]:
        """The law's domain, mirrored."""
        return _mirrored_interval(self.law.domain)

    @property
    def torque_range(self) -> tuple[float, float]:
        """The law's range, mirrored."""
        return _mirrored_interval(self.law.torque_range)

    @property
    def pulls_only(self) -> bool:
        """Whether the law only pulls."""
        return self.law.pulls_only

    @property
    def polynomial(self) -> tuple[float, ...] | None:
        """Terms of odd power are the law's, those of even power their opposites."""
        terms = self.law.polynomial
        return terms and tuple(term if power % 2 else -term for power, term in enumerate(terms, 1))

    def hardening(self, phi: FloatArray) -> FloatArray:
        """The hardening is odd in the deflection."""
        return -self.law.hardening(-phi)

    def derivatives(self, phi: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """The torque is odd in the deflection, its derivatives are even and odd in turn."""
        values = self.law.derivatives(-phi, order)
        return tuple(value if each % 2 else -value for each, value in enumerate(values))

    def deflection_and_state(self, torque: FloatArray) -> tuple[FloatArray, SpringState]:
        """Both are those of the law under the opposite torque, mirrored."""
        phi, state = self.law.deflection_and_state(-torque)
        return -phi, _mirrored_state(state)

    def energy_and_state(self, phi: FloatArray) -> tuple[FloatArray, SpringState]:
        """The energy is even in the deflection."""
        energy, state = self.law.energy_and_state(-phi)
        return energy, _mirrored_state(state)

    def torque(self, phi: FloatArray) -> FloatArray:
        """The torque is odd in the deflection."""
        return -self.law.torque(-phi)

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """The stiffness is even in the deflection."""
        return self.law.stiffness(-phi)

    def slope(self, phi: FloatArray) -> FloatArray:
        """The slope is odd in the deflection."""
        return -self.law.slope(-phi)

    def curvature(self, phi: FloatArray) -> FloatArray:
        """The curvature is even in the deflection."""
        return self.law.curvature(-phi)

    def energy(self, phi: FloatArray) -> FloatArray:
        """The energy is even in the deflection."""
        return self.law.energy(-phi)

    def deflection(self, torque: FloatArray) -> FloatArray:
        """The deflection is odd in the torque."""
        return -self.law.deflection(-torque)


def _mirrored_state(state: SpringState) -> SpringState:
    """Of the state, the torque and the slope are odd in the deflection."""
    return state._replace(tau=-state.tau, zeta=-state.zeta)


def _mirrored_interval(interval: tuple[float, float]) -> tuple[float, float]:
    low, high = interval
    return -high, -low
