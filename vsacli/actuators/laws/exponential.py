"""The exponential tendon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli.actuators.laws.law import SpringLaw, alike
from vsacli.actuators.laws.pair import Pair, PairSolution, tendon_solution
from vsacli.actuators.laws.tendon import Mirrored, Tendon
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.documents.fields import POSITIVE, number


@dataclass(frozen=True)
class Exponential(Tendon):
    """tau = c (exp(a phi) - 1) for phi >= 0, so that sigma = a (tau + c)."""

    c: float = number(units.TORQUE, "torque scale c", check=POSITIVE)
    a: float = number(units.INVERSE_POSITION, "inverse deflection scale a", check=POSITIVE)

    def closed_pair(self, other: SpringLaw) -> Pair | None:
        """The closed pair with a tendon of the same a on side 2."""
        second = other.law if isinstance(other, Mirrored) else None
        if isinstance(second, Exponential) and alike(second.a, self.a):
            return ExponentialPair(self, second)
        return None

    def derivatives(self, phi: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """Torque and stiffness, and the others each a times the one before."""
        torque = self.torque(phi)
        stiffness = self.a * (torque + self.c)
        return (torque, stiffness, self.a * stiffness, self.a**2 * stiffness)[: order + 1]

    def torque(self, phi: FloatArray) -> FloatArray:
        """Torque c (exp(a phi) - 1)."""
        return self.c * np.expm1(self.a * phi)

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Stiffness a (tau + c)."""
        return self.a * (self.torque(phi) + self.c)

    def slope(self, phi: FloatArray) -> FloatArray:
        """Slope a sigma."""
        return self.a * self.stiffness(phi)

    def curvature(self, phi: FloatArray) -> FloatArray:
        """Curvature a^2 sigma."""
        return self.a**2 * self.stiffness(phi)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Energy tau/a - c phi."""
        return self.torque(phi) / self.a - self.c * phi

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Inverse ln(1 + tau/c)/a."""
        return np.log1p(np.maximum(torque, 0) / self.c) / self.a


@dataclass(frozen=True)
class ExponentialPair(Pair):
    """Two exponential tendons of the same a: sigma/a = tau_1 + |tau_2| + c_1 + c_2; never singular."""

    first: Exponential
    second: Exponential

    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) for each sample; see `Pair.solve`."""
        a, rest = self.first.a, self.first.c + self.second.c
        lower = a * (np.abs(tau_e) + rest)
        pull = np.maximum(stiffness, lower) / a - rest
        return tendon_solution(
            lower,
            phi_1=self.first.deflection((pull + tau_e) / 2),
            phi_2=-self.second.deflection((pull - tau_e) / 2),
        )
