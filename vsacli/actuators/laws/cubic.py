"""The cubic spring of the paper, (24)-(27), and the closed solution of (14) for two equal ones, (28)-(31)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vsacli.actuators.laws.law import Pair, PairSolution, SpringLaw
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.documents.fields import POSITIVE, number


@dataclass(frozen=True)
class Cubic(SpringLaw):
    """Cubic spring tau = k phi + k_c phi^3 (24), Buondonno & De Luca (2016)."""

    k: float = number(units.STIFFNESS, "linear coefficient K", check=POSITIVE)
    k_c: float = number(units.CUBIC_STIFFNESS, "cubic coefficient Kc", check=POSITIVE)

    examples: ClassVar = {"revolute": {"k": 400, "k_c": 2000}, "prismatic": {"k": 4000, "k_c": 200000}}

    @property
    def polynomial(self) -> tuple[float, ...]:
        """Coefficients of phi, phi^2 and phi^3."""
        return (self.k, 0.0, self.k_c)

    def closed_pair(self, other: SpringLaw) -> Pair | None:
        """Return the closed solution for two equal cubic springs; None for other laws."""
        return CubicTwins(self) if other == self else None

    def torque(self, phi: FloatArray) -> FloatArray:
        """Return the torque (24)."""
        return phi * (self.k + self.k_c * phi * phi)

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Return the stiffness (25)."""
        return self.k + 3 * self.k_c * phi * phi

    def slope(self, phi: FloatArray) -> FloatArray:
        """Return the slope of the stiffness (26)."""
        return 6 * self.k_c * phi

    def curvature(self, phi: FloatArray) -> FloatArray:
        """Return the curvature of the stiffness (27)."""
        return np.full_like(phi, 6 * self.k_c)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the energy K phi^2/2 + Kc phi^4/4."""
        squared = phi * phi
        return squared * (self.k / 2 + self.k_c / 4 * squared)

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Return the real root of (24) by the hyperbolic formula, which has no cancellation."""
        scale = np.sqrt(self.k / (3 * self.k_c))
        deflection: FloatArray = 2 * scale * np.sinh(np.arcsinh(1.5 * torque / (self.k * scale)) / 3)
        return deflection


@dataclass(frozen=True)
class CubicTwins(Pair):
    """Two equal cubic springs, (28)-(31) without the angle xi.

    With the stiffness sigma, u = phi_1 + phi_2 and the spread phi_1 - phi_2, (29) gives
    spread^2 = 2 (sigma - 2 K)/(3 Kc) - u^2. Inserted into (28), u solves the cubic equation
    sigma u/2 - Kc u^3/2 = tau_e.
    """

    spring: Cubic

    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) for each sample; see `Pair.solve`."""
        k, k_c = self.spring.k, self.spring.k_c
        lower = self._lowest_stiffness(np.abs(tau_e))
        sigma = np.maximum(stiffness, lower)
        # The root of the cubic in u with the largest phi_1 - phi_2, by the trigonometric formula.
        sine = np.clip(3 * np.sqrt(3 * k_c) * tau_e / (sigma * np.sqrt(sigma)), -1, 1)
        u = 2 * np.sqrt(sigma / (3 * k_c)) * np.sin(np.arcsin(sine) / 3)
        spread_squared = 2 * (sigma - 2 * k) / (3 * k_c) - u * u
        spread = np.sqrt(np.maximum(spread_squared, 0))
        return PairSolution.unbounded(lower, (u + spread) / 2, (u - spread) / 2, lower_critical=True)

    def _lowest_stiffness(self, load: FloatArray) -> FloatArray:
        """Return the stiffness at the outermost critical point (det A = 0) under a load |tau_e|.

        It is phi_1 = phi_2, the bound on tau_e after (31) solved for sigma; beyond the load where that meets
        phi_1 phi_2 = K/(3 Kc), it is the latter: there sigma = 3 Kc u^2 and tau_e = Kc u^3, where the sine in
        `solve` is 1 (the paper's remark on sigma > 4 K).
        """
        k, k_c = self.spring.k, self.spring.k_c
        at_equal_deflections = 2 * self.spring.stiffness(self.spring.deflection(load / 2))
        at_unequal_deflections = np.cbrt((3 * np.sqrt(3 * k_c) * load) ** 2)
        meeting_load = 8 / 3 * k * np.sqrt(k / (3 * k_c))
        return np.where(load <= meeting_load, at_equal_deflections, at_unequal_deflections)
