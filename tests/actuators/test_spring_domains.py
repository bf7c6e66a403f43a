"""Laws whose torque grows without bound at a finite deflection: the solver stays within their domain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from vsacli import laws


@dataclass(frozen=True)
class Tangent(laws.SpringLaw):
    """tau = k tan(phi), |phi| < pi/2."""

    k: float = 1.0

    @property
    def domain(self) -> tuple[float, float]:
        return (-np.pi / 2, np.pi / 2)

    def torque(self, phi: np.ndarray) -> np.ndarray:
        return self.k * np.tan(phi)

    def stiffness(self, phi: np.ndarray) -> np.ndarray:
        return self.k / np.cos(phi) ** 2

    def slope(self, phi: np.ndarray) -> np.ndarray:
        return 2 * self.k * np.tan(phi) / np.cos(phi) ** 2

    def curvature(self, phi: np.ndarray) -> np.ndarray:
        return 2 * self.k * (1 + 2 * np.sin(phi) ** 2) / np.cos(phi) ** 4

    def energy(self, phi: np.ndarray) -> np.ndarray:
        return -self.k * np.log(np.cos(phi))

    def deflection(self, torque: np.ndarray) -> np.ndarray:
        return np.arctan(torque / self.k)


@pytest.mark.parametrize("ratio", [1.0, 1.2, 7.0])
def test_the_torques_say_what_the_deflections_are(ratio):
    """sigma = k + tau^2/k makes a quadratic equation of (14), whose roots know no domain."""
    first, second = Tangent(k=100.0), Tangent(k=100.0 * ratio)
    tau_e, stiffness = (grid.ravel() for grid in np.meshgrid(np.linspace(-300, 300, 41), [900.0, 3e3, 1e6]))
    solution = laws.make_pair(first, second).solve(tau_e, stiffness)

    k_1, k_2 = first.k, second.k
    half, square = tau_e / k_2, 1 / k_1 + 1 / k_2
    rest = k_1 + k_2 + tau_e**2 / k_2 - stiffness
    discriminant = half**2 - square * rest
    reachable = discriminant > 0
    assert reachable.sum() > reachable.size / 2
    tau_1 = (half + np.sqrt(np.where(reachable, discriminant, np.nan))) / square
    # Deflections are good to 1e-16 over the margin, of which the grid has 1e-4 and more.
    np.testing.assert_allclose(
        solution.phi_1[reachable], np.arctan(tau_1 / k_1)[reachable], rtol=0, atol=1e-11
    )
    np.testing.assert_allclose(
        solution.phi_2[reachable], np.arctan((tau_e - tau_1) / k_2)[reachable], rtol=0, atol=1e-11
    )
    np.testing.assert_array_equal(reachable, solution.lower <= stiffness)
