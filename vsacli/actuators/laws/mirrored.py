"""A law turned around, as a tendon acts on side 2."""

from __future__ import annotations

from dataclasses import dataclass, field

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.laws.state import SpringState
from vsacli.base.arrays import FloatArray


@dataclass(frozen=True)
class Mirrored(SpringLaw):
    """tau(phi) = -law.tau(-phi)."""

    law: SpringLaw = field(kw_only=True)

    @property
    def domain(self) -> tuple[float, float]:
        """The law's domain, turned around."""
        return _turned(self.law.domain)

    @property
    def torque_range(self) -> tuple[float, float]:
        """The law's range, turned around."""
        return _turned(self.law.torque_range)

    @property
    def pulls_only(self) -> bool:
        """As the law."""
        return self.law.pulls_only

    def hardening(self, phi: FloatArray) -> FloatArray:
        """Odd in the deflection."""
        return -self.law.hardening(-phi)

    def derivatives(self, phi: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """Odd and even in turn."""
        values = self.law.derivatives(-phi, order)
        return tuple(value if each % 2 else -value for each, value in enumerate(values))

    def under(self, torque: FloatArray) -> tuple[FloatArray, SpringState]:
        """As the law under the opposite torque."""
        phi, spring = self.law.under(-torque)
        return -phi, _mirrored(spring)

    def loaded(self, phi: FloatArray) -> tuple[FloatArray, SpringState]:
        """Even and odd in turn."""
        energy, spring = self.law.loaded(-phi)
        return energy, _mirrored(spring)

    def torque(self, phi: FloatArray) -> FloatArray:
        """Odd in the deflection."""
        return -self.law.torque(-phi)

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Even in the deflection."""
        return self.law.stiffness(-phi)

    def slope(self, phi: FloatArray) -> FloatArray:
        """Odd in the deflection."""
        return -self.law.slope(-phi)

    def curvature(self, phi: FloatArray) -> FloatArray:
        """Even in the deflection."""
        return self.law.curvature(-phi)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Even in the deflection."""
        return self.law.energy(-phi)

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Odd in the torque."""
        return -self.law.deflection(-torque)


def _mirrored(spring: SpringState) -> SpringState:
    return spring._replace(tau=-spring.tau, zeta=-spring.zeta)


def _turned(interval: tuple[float, float]) -> tuple[float, float]:
    low, high = interval
    return -high, -low
