"""The hyperbolic-sine spring of the qbmove and VSA-CubeBot family."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli import units
from vsacli.arrays import FloatArray
from vsacli.spec.fields import POSITIVE, number
from vsacli.springs.law import SpringLaw
from vsacli.springs.pair import Pair, PairSolution


@dataclass(frozen=True)
class Sinh(SpringLaw):
    """tau = k sinh(a phi); qbmove advanced kit manual (April 2021), section 3.2.2."""

    k: float = number(units.TORQUE, "torque scale k", check=POSITIVE)
    a: float = number(units.INVERSE_POSITION, "inverse deflection scale a", check=POSITIVE)

    def closed_pair(self, other: SpringLaw) -> Pair | None:
        """Closed where both sides have the same a."""
        return SinhPair(self, other) if isinstance(other, Sinh) and other.a == self.a else None

    def torque(self, phi: FloatArray) -> FloatArray:
        """Torque k sinh(a phi)."""
        return self.k * np.sinh(self.a * phi)

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Stiffness k a cosh(a phi)."""
        return self.k * self.a * np.cosh(self.a * phi)

    def slope(self, phi: FloatArray) -> FloatArray:
        """Slope a^2 tau."""
        return self.a**2 * self.torque(phi)

    def curvature(self, phi: FloatArray) -> FloatArray:
        """Curvature a^2 sigma."""
        return self.a**2 * self.stiffness(phi)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Energy k (cosh(a phi) - 1)/a, without cancellation near zero."""
        return 2 * self.k / self.a * np.sinh(self.a * phi / 2) ** 2

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Inverse asinh(tau/k)/a."""
        return np.arcsinh(torque / self.k) / self.a


@dataclass(frozen=True)
class SinhPair(Pair):
    """Two sinh springs of the same a, from their sum and difference.

    With x = sigma/a: x^2 - tau_e^2 = k_1^2 + k_2^2 + 2 k_1 k_2 cosh(a(phi_1 - phi_2)), and
    x +- tau_e = k_1 exp(+-a phi_1) + k_2 exp(+-a phi_2).
    """

    first: Sinh
    second: Sinh

    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) for each sample; see `Pair.solve`."""
        a, k_1, k_2 = self.first.a, self.first.k, self.second.k
        lower = a * np.hypot(tau_e, k_1 + k_2)
        demand = np.maximum(stiffness, lower)
        excess = (demand - lower) / a * ((demand + lower) / a)
        spread = 2 * np.arcsinh(np.sqrt(excess / (4 * k_1 * k_2)))
        # The sign that adds x and |tau_e| keeps the digits.
        sign = np.where(tau_e < 0, -1.0, 1.0)
        exponential = (demand / a + np.abs(tau_e)) / (k_1 * np.exp(sign * spread) + k_2)
        phi_2 = sign * np.log(exponential) / a
        return PairSolution(
            lower=lower,
            upper=np.full_like(tau_e, np.inf),
            lower_critical=np.ones(tau_e.shape, dtype=bool),
            upper_critical=np.zeros(tau_e.shape, dtype=bool),
            slack_below=np.zeros(tau_e.shape, dtype=bool),
            phi_1=phi_2 + spread / a,
            phi_2=phi_2,
        )
