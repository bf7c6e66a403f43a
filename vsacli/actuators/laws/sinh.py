"""The hyperbolic-sine spring of the qbmove and VSA-CubeBot family."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vsacli.actuators.laws.law import LawByDerivatives, Pair, PairSolution, SpringLaw, same_number
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.documents.fields import POSITIVE, number


@dataclass(frozen=True)
class Sinh(LawByDerivatives):
    """Spring tau = k sinh(a phi) of qbmove and VSA-CubeBot; qbmove Advanced manual (April 2021), 3.2.2."""

    k: float = number(units.TORQUE, "torque scale k", check=POSITIVE)
    a: float = number(units.INVERSE_POSITION, "inverse deflection scale a", check=POSITIVE)

    examples: ClassVar = {"revolute": {"k": 80, "a": 5}, "prismatic": {"k": 160, "a": 25}}

    def closed_pair(self, other: SpringLaw) -> Pair | None:
        """Return the closed solution for two springs of equal a; None for other laws."""
        return SinhPair(self, other) if isinstance(other, Sinh) and same_number(other.a, self.a) else None

    def derivatives(self, phi: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """Return torque and stiffness from one exponential function, and a^2 times each."""
        growth = np.expm1(np.abs(self.a * phi))
        decay = 1 / (1 + growth)
        half = self.k / 2 * growth
        torque = np.copysign(half * (1 + decay), phi)
        stiffness = self.a * (self.k + half * (1 - decay))
        return (torque, stiffness, self.a**2 * torque, self.a**2 * stiffness)[: order + 1]

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the energy k (cosh(a phi) - 1)/a, without cancellation near zero."""
        return 2 * self.k / self.a * np.sinh(self.a * phi / 2) ** 2

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Return the inverse asinh(tau/k)/a."""
        return np.arcsinh(torque / self.k) / self.a


@dataclass(frozen=True)
class SinhPair(Pair):
    """Two sinh springs of equal a, solved for the sum and the difference of their deflections.

    With h = a(phi_1 - phi_2)/2, m = a(phi_1 + phi_2)/2 and x = sigma/a:
    x^2 - tau_e^2 = (k_1 + k_2)^2 + 4 k_1 k_2 sinh(h)^2 = R^2, and
    m = asinh(tau_e/R) - asinh((k_1 - k_2) sinh(h)/R).
    """

    first: Sinh
    second: Sinh

    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) for each sample; see `Pair.solve`."""
        a, k_1, k_2 = self.first.a, self.first.k, self.second.k
        lower = a * np.hypot(tau_e, k_1 + k_2)
        demand = np.maximum(stiffness, lower)
        sinh = np.sqrt((demand - lower) / (2 * a * k_1)) * np.sqrt((demand + lower) / (2 * a * k_2))
        radius = np.hypot(k_1 + k_2, 2 * np.sqrt(k_1) * np.sqrt(k_2) * sinh)
        mean = np.arcsinh(tau_e / radius) - np.arcsinh((k_1 - k_2) / radius * sinh)
        half_spread = np.arcsinh(sinh)
        phi_1, phi_2 = (mean + half_spread) / a, (mean - half_spread) / a
        # The weaker spring absorbs the rounding error of the torque balance.
        if k_1 < k_2:
            phi_1 = self.first.deflection(tau_e - self.second.torque(phi_2))
        elif k_2 < k_1:
            phi_2 = self.second.deflection(tau_e - self.first.torque(phi_1))
        return PairSolution.unbounded(lower, phi_1, phi_2, lower_critical=True)
