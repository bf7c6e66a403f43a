"""The four-bar transmission of the VSA-II."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from vsacli.actuators.laws.inversion import FirstGuess, deflection_at_torque, with_sign_of
from vsacli.actuators.laws.law import LawByDerivatives, SpringState
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.documents.fields import POSITIVE, Check, number

ABOVE_ONE = Check(lambda ratio: ratio > 1 and math.isfinite(ratio), "greater than 1")

STRETCH_MARGIN = 1e-6
"""Distance of C sin(phi/2) from 1 at the end of the domain.

Closer to 1, where the torque grows without bound, adjacent doubles of the deflection differ in stiffness by
more than 1e-10.
"""

GUESS_NODES = 20
"""Number of initial nodes of the first guess of the inverse."""


@dataclass(frozen=True)
class FourBar(LawByDerivatives):
    """Linear spring behind a four-bar linkage: U = k beta^2/2, beta = asin(C sin(phi/2)) - phi/2, C > 1.

    The form of the VSA-II, Schiavi, Grioli, Sen & Bicchi, ICRA 2008. Its domain ends where the linkage is
    stretched, |phi| = 2 asin(1/C).
    """

    k: float = number(units.TORQUE, "constant k of the linear spring, per rad of beta", check=POSITIVE)
    ratio: float = number(units.DIMENSIONLESS, "ratio C of the linkage's arms", check=ABOVE_ONE)

    examples: ClassVar = {"revolute": {"k": 1600, "ratio": 2}}

    @property
    def domain(self) -> tuple[float, float]:
        """Deflections up to the stretched linkage, less `STRETCH_MARGIN`."""
        end = 2 * np.arcsin((1 - STRETCH_MARGIN) / self.ratio)
        return (-end, end)

    @cached_property
    def torque_range(self) -> tuple[float, float]:
        """Torques at the ends of the domain."""
        low, high = map(self.torque, self.domain)  # type: ignore[arg-type]  # numbers are arrays, too
        return low, high  # type: ignore[return-value]

    def derivatives(self, phi: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """Return the derivatives of the energy k beta^2/2, which share the angles."""
        return _energy_derivatives(self.k, self._angle(phi, order + 1))

    def energy_and_state(self, phi: FloatArray) -> tuple[FloatArray, SpringState]:
        """Return energy and all derivatives, which share the angles."""
        beta = self._angle(phi, 4)
        return self.k / 2 * beta[0] * beta[0], SpringState(*_energy_derivatives(self.k, beta))

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the energy k beta^2/2."""
        (beta,) = self._angle(phi, 0)
        return self.k / 2 * beta * beta

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Return the inverse, by safeguarded iteration within the domain."""
        return self.deflection_and_state(torque)[0]

    def deflection_and_state(self, torque: FloatArray) -> tuple[FloatArray, SpringState]:
        """Return deflection and state by one iteration."""
        load = np.minimum(np.abs(torque), self.torque_range[1])
        low, high = np.zeros_like(load), np.full_like(load, self.domain[1])
        start = np.minimum(self._first_guess(load), high)
        return with_sign_of(torque, *deflection_at_torque(self, load, low, high, start))

    @cached_property
    def _first_guess(self) -> FirstGuess:
        """First guess of the inverse, from nodes over the domain, denser towards its end."""
        psi = np.linspace(0, math.pi / 2, GUESS_NODES)
        return FirstGuess(self, 2 * np.arcsin((1 - STRETCH_MARGIN) * np.sin(psi) / self.ratio))

    def _angle(self, phi: FloatArray, order: int) -> list[FloatArray]:
        """Return the angle beta of the linear spring, and its derivatives up to an order, 4 at most.

        With psi = asin(C sin(phi/2)) and beta = psi - phi/2, written by
        C cos(phi/2) - cos psi = (C^2 - 1)/(C cos(phi/2) + cos psi), so that nothing cancels. The higher
        derivatives of beta are those of psi, with psi'' = (psi'^2 - 1/4) tan psi. Sines and cosines are
        multiplied by 1 + tan^2(phi/4).
        """
        tangent = np.tan(phi / 4)
        factor = 1 + tangent * tangent
        sin_psi, ratio_cos = 2 * self.ratio * tangent, self.ratio * (2 - factor)
        cos_psi = np.sqrt((factor - sin_psi) * (factor + sin_psi))
        quotient = (self.ratio - 1) * (self.ratio + 1) / (ratio_cos + cos_psi)
        beta = [np.arcsin(2 * tangent * quotient)]
        if order > 0:
            half_secant = 0.5 / cos_psi
            beta.append(quotient * factor * factor * half_secant)
        if order > 1:
            dpsi, tan_psi = ratio_cos * half_secant, sin_psi / cos_psi
            excess = beta[1] * (dpsi + 0.5)  # psi'^2 - 1/4
            beta.append(excess * tan_psi)
        if order > 2:
            growth = 1 + 3 * (tan_psi * tan_psi)
            beta.append(dpsi * excess * growth)
        if order > 3:
            squared = 4 * dpsi * dpsi
            beta.append(beta[2] * (growth * (excess + squared) + squared))
        return beta


def _energy_derivatives(k: float, beta: list[FloatArray]) -> tuple[FloatArray, ...]:
    """Return the derivatives of k beta^2/2 from beta and its derivatives, one fewer than these.

    They are k beta beta', k (beta'^2 + beta beta''), k (3 beta' beta'' + beta beta''') and
    k (3 beta''^2 + 4 beta' beta''' + beta beta'''').
    """
    k_beta, k_rate = k * beta[0], k * beta[1]
    derivatives = [k_beta * beta[1]]
    if len(beta) > 2:
        derivatives.append(k_rate * beta[1] + k_beta * beta[2])
    if len(beta) > 3:
        derivatives.append(3 * k_rate * beta[2] + k_beta * beta[3])
    if len(beta) > 4:
        derivatives.append(3 * k * beta[2] * beta[2] + 4 * k_rate * beta[3] + k_beta * beta[4])
    return tuple(derivatives)
