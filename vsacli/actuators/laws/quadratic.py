"""The quadratic tendon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.laws.pair import Pair, PairSolution, tendon_solution
from vsacli.actuators.laws.tendon import Tendon
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.documents.fields import POSITIVE, number


@dataclass(frozen=True)
class Quadratic(Tendon):
    """tau = k phi^2 for phi >= 0; a pair of them behaves as an elastic joint of any chosen stiffness."""

    k: float = number(units.QUADRATIC_STIFFNESS, "quadratic coefficient k", check=POSITIVE)

    @property
    def polynomial(self) -> tuple[float, ...]:
        """The quadratic term alone."""
        return (0.0, self.k)

    def closed_pair(self, other: SpringLaw) -> Pair | None:
        """The closed pair of twins."""
        return QuadraticTwins(self) if other == self.as_second() else None

    def hardening(self, phi: FloatArray) -> FloatArray:
        """Hardening 1/phi, infinite where the tendon goes slack."""
        with np.errstate(divide="ignore"):
            return 1 / np.abs(phi)

    def torque(self, phi: FloatArray) -> FloatArray:
        """Torque k phi^2."""
        return self.k * phi * phi

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Stiffness 2 k phi."""
        return 2 * self.k * phi

    def slope(self, phi: FloatArray) -> FloatArray:
        """Slope 2 k."""
        return np.where(np.isnan(phi), np.nan, 2 * self.k)

    def curvature(self, phi: FloatArray) -> FloatArray:
        """Curvature zero."""
        return np.zeros_like(phi)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Energy k phi^3/3."""
        return self.k * phi * phi * phi / 3

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Inverse sqrt(tau/k)."""
        return np.sqrt(np.maximum(torque, 0) / self.k)


@dataclass(frozen=True)
class QuadraticTwins(Pair):
    """Two equal quadratic tendons: phi_1 - phi_2 = sigma/(2 k), phi_1 + phi_2 = 2 tau_e/sigma."""

    spring: Quadratic

    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) for each sample; see `Pair.solve`."""
        lower = 2 * np.sqrt(self.spring.k * np.abs(tau_e))
        demand = np.maximum(stiffness, lower)
        mean, half_spread = tau_e / demand, demand / (4 * self.spring.k)
        return tendon_solution(lower, phi_1=mean + half_spread, phi_2=mean - half_spread)
