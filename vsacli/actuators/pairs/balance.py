"""Joint stiffness of two springs that share a given elastic torque."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.laws.state import SpringState
from vsacli.actuators.pairs.state import PairState
from vsacli.base.arrays import BoolArray, FloatArray


@dataclass(frozen=True)
class Balance:
    """Two springs, and the preload torque t between them: tau_1 = tau_e/2 + t and tau_2 = tau_e/2 - t.

    The joint stiffness G = sigma_1 + sigma_2 has the slope dG/dt = rho_1 - rho_2 with the relative hardening
    rho_k = zeta_k/sigma_k, and det A = -sigma_1 sigma_2 dG/dt. Arrays of any one shape.
    """

    first: SpringLaw
    second: SpringLaw

    @cached_property
    def ends(self) -> tuple[tuple[SpringState, ...], ...]:
        """Each spring at the two ends of its domain; scalars, unknown where there is no end."""
        with np.errstate(all="ignore"):
            return tuple(
                tuple(law.state(np.array(phi)) for phi in law.domain) for law in (self.first, self.second)
            )

    def at(self, tau_e: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """phi_1 and phi_2 at a preload torque."""
        return self.under(tau_e / 2 + t, tau_e / 2 - t)

    def under(self, tau_1: FloatArray, tau_2: FloatArray) -> tuple[FloatArray, FloatArray]:
        """phi_1 and phi_2 under the torques of the two springs."""
        return self.first.deflection(tau_1), self.second.deflection(tau_2)

    def state(self, phi_1: FloatArray, phi_2: FloatArray) -> PairState:
        """The springs at deflections."""
        return PairState(phi_1, phi_2, self.first.state(phi_1), self.second.state(phi_2))

    def stiffness(self, phi_1: FloatArray, phi_2: FloatArray) -> FloatArray:
        """G."""
        return self.first.stiffness(phi_1) + self.second.stiffness(phi_2)

    def slope(self, phi_1: FloatArray, phi_2: FloatArray) -> FloatArray:
        """dG/dt."""
        return self.first.hardening(phi_1) - self.second.hardening(phi_2)

    def domain(self, tau_e: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Smallest and largest t for which both laws hold; smallest > largest if there is none."""
        (low_1, high_1), (low_2, high_2) = self.first.torque_range, self.second.torque_range
        return (
            np.maximum(low_1 - tau_e / 2, tau_e / 2 - high_2),
            np.minimum(high_1 - tau_e / 2, tau_e / 2 - low_2),
        )

    def is_slack(self, tau_e: FloatArray, t: FloatArray) -> BoolArray:
        """Whether a side that only pulls carries no torque."""
        if not (self.first.pulls_only or self.second.pulls_only):
            return np.zeros_like(tau_e, dtype=bool)
        slack: BoolArray = (self.first.pulls_only & (tau_e / 2 + t == 0)) | (
            self.second.pulls_only & (tau_e / 2 - t == 0)
        )
        return slack
