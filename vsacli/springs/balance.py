"""Joint stiffness of two springs that share a given elastic torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli.arrays import BoolArray, FloatArray
from vsacli.springs.law import SpringLaw


@dataclass(frozen=True)
class Balance:
    """Two springs in the preload torque t, where tau_1 = tau_e/2 + t and tau_2 = tau_e/2 - t.

    The joint stiffness G(t) = sigma_1 + sigma_2 has the slope dG/dt = rho_1 - rho_2 with the relative
    hardening rho_k = zeta_k/sigma_k, and det A = -sigma_1 sigma_2 dG/dt. Arrays of any one shape.
    """

    first: SpringLaw
    second: SpringLaw

    def deflections(self, tau_1: FloatArray, tau_2: FloatArray) -> tuple[FloatArray, FloatArray]:
        """phi_1 and phi_2 under the torques of the two springs."""
        return self.first.deflection(tau_1), self.second.deflection(tau_2)

    def stiffness(self, tau_1: FloatArray, tau_2: FloatArray) -> FloatArray:
        """G under the torques of the two springs."""
        phi_1, phi_2 = self.deflections(tau_1, tau_2)
        return self.first.stiffness(phi_1) + self.second.stiffness(phi_2)

    def slope(self, t: FloatArray, tau_e: FloatArray) -> FloatArray:
        """dG/dt."""
        phi_1, phi_2 = self.deflections(*torques(t, tau_e))
        return self.first.hardening(phi_1) - self.second.hardening(phi_2)

    def domain(self, tau_e: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Smallest and largest t for which both laws hold; smallest > largest if there is none."""
        (low_1, high_1), (low_2, high_2) = self.first.torque_range, self.second.torque_range
        return (
            np.maximum(low_1 - tau_e / 2, tau_e / 2 - high_2),
            np.minimum(high_1 - tau_e / 2, tau_e / 2 - low_2),
        )

    def is_slack(self, t: FloatArray, tau_e: FloatArray) -> BoolArray:
        """Whether a side that only pulls carries no torque."""
        tau_1, tau_2 = torques(t, tau_e)
        slack: BoolArray = (self.first.pulls_only & (tau_1 == 0)) | (self.second.pulls_only & (tau_2 == 0))
        return slack

    def slope_is_monotone(self, tau_e: FloatArray) -> BoolArray:
        """Whether dG/dt surely increases with t as long as both torques have the sign of tau_e."""
        (low_1, high_1), (low_2, high_2) = self.first.hardening_peak, self.second.hardening_peak
        return (max(low_1, low_2) <= tau_e) & (tau_e <= min(high_1, high_2))


def torques(t: FloatArray, tau_e: FloatArray) -> tuple[FloatArray, FloatArray]:
    """tau_1 and tau_2 at a preload torque."""
    return tau_e / 2 + t, tau_e / 2 - t
