"""The four-bar transmission of the VSA-II."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vsacli import units
from vsacli.arrays import FloatArray
from vsacli.spec.fields import POSITIVE, Check, number
from vsacli.springs.inversion import FirstGuess, inverse
from vsacli.springs.law import SpringLaw

ABOVE_ONE = Check(lambda ratio: ratio > 1 and math.isfinite(ratio), "greater than 1")

STRETCHED = 1e-6
"""How close to 1 the domain lets C sin(phi/2) come. Beyond, where the torque grows without bound, deflections
that are neighbouring doubles differ in stiffness by more than 1e-10."""

NODES = 500
"""Points of the curve between which the inverse begins."""


@dataclass(frozen=True)
class FourBar(SpringLaw):
    """Linear spring behind a four-bar linkage: U = k beta^2/2, beta = asin(C sin(phi/2)) - phi/2, C > 1.

    The form of the VSA-II, Schiavi, Grioli, Sen & Bicchi, ICRA 2008. Its domain ends where the linkage is
    stretched, |phi| = 2 asin(1/C).
    """

    k: float = number(units.TORQUE, "constant k of the linear spring, per rad of beta", check=POSITIVE)
    ratio: float = number(units.DIMENSIONLESS, "ratio C of the linkage's arms", check=ABOVE_ONE)

    @property
    def domain(self) -> tuple[float, float]:
        """Up to the stretched linkage, all but a millionth."""
        end = 2 * math.asin((1 - STRETCHED) / self.ratio)
        return (-end, end)

    @cached_property
    def torque_range(self) -> tuple[float, float]:
        """Torques at the ends of the domain."""
        low, high = self.torque(np.array(self.domain))
        return float(low), float(high)

    def derivatives(self, phi: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """Derivatives of the energy k beta^2/2, which share the angles."""
        crank = _Crank(self.ratio, phi)
        return tuple(self.k * derivative(crank) for derivative in _DERIVATIVES[: order + 1])

    def torque(self, phi: FloatArray) -> FloatArray:
        """Torque k beta beta'."""
        return self.k * _torque(_Crank(self.ratio, phi))

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Stiffness k (beta'^2 + beta beta'')."""
        return self.k * _stiffness(_Crank(self.ratio, phi))

    def slope(self, phi: FloatArray) -> FloatArray:
        """Slope k (3 beta' beta'' + beta beta''')."""
        return self.k * _slope(_Crank(self.ratio, phi))

    def curvature(self, phi: FloatArray) -> FloatArray:
        """Curvature k (3 beta''^2 + 4 beta' beta''' + beta beta'''')."""
        return self.k * _curvature(_Crank(self.ratio, phi))

    def energy(self, phi: FloatArray) -> FloatArray:
        """Energy k beta^2/2."""
        return self.k * _Crank(self.ratio, phi).beta ** 2 / 2

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Inverse by safeguarded iteration within the domain."""
        load = np.minimum(np.abs(torque), self.torque_range[1])
        low, high = np.zeros_like(load), np.full_like(load, self.domain[1])
        start = np.clip(self._first_guess(load), low, high)
        return np.copysign(inverse(self, load, low, high, start), torque)

    @cached_property
    def _first_guess(self) -> FirstGuess:
        """From nodes over the domain, denser towards its end."""
        psi = np.linspace(0, math.pi / 2, NODES)
        return FirstGuess(self, 2 * np.arcsin((1 - STRETCHED) * np.sin(psi) / self.ratio))


class _Crank:
    """Angle beta of the linear spring over the deflection, with four derivatives.

    With psi = asin(C sin(phi/2)) and beta = psi - phi/2, written by
    C cos(phi/2) - cos psi = (C^2 - 1)/(C cos(phi/2) + cos psi), so that nothing cancels.
    """

    def __init__(self, ratio: float, phi: FloatArray) -> None:
        self._sin, self._cos = np.sin(phi / 2), np.cos(phi / 2)
        self._sin_psi, self._c_cos = ratio * self._sin, ratio * self._cos
        self._room = (1 - self._sin_psi) * (1 + self._sin_psi)
        self._cos_psi: FloatArray = np.sqrt(self._room)
        self._bend = ratio * (ratio - 1) * (ratio + 1)
        self._gain = (ratio - 1) * (ratio + 1) / (self._c_cos + self._cos_psi)

    @cached_property
    def beta(self) -> FloatArray:
        angle: FloatArray = np.arctan2(
            self._sin * self._gain, self._cos_psi * self._cos + self._sin_psi * self._sin
        )
        return angle

    @cached_property
    def d1(self) -> FloatArray:
        return self._gain / (2 * self._cos_psi)

    @cached_property
    def d2(self) -> FloatArray:
        return self._bend / 4 * self._sin / (self._room * self._cos_psi)

    @cached_property
    def d3(self) -> FloatArray:
        return self._bend / 8 * self._cos * (1 + 2 * self._sin_psi**2) / (self._room**2 * self._cos_psi)

    @cached_property
    def d4(self) -> FloatArray:
        grown = 1 + 2 * self._sin_psi**2
        fourth = self._c_cos**2 * (2 * self._room + 2.5 * grown) - grown * self._room / 2
        return self._bend / 8 * self._sin * fourth / (self._room**3 * self._cos_psi)


def _torque(crank: _Crank) -> FloatArray:
    return crank.beta * crank.d1


def _stiffness(crank: _Crank) -> FloatArray:
    return crank.d1**2 + crank.beta * crank.d2


def _slope(crank: _Crank) -> FloatArray:
    return 3 * crank.d1 * crank.d2 + crank.beta * crank.d3


def _curvature(crank: _Crank) -> FloatArray:
    return 3 * crank.d2**2 + 4 * crank.d1 * crank.d3 + crank.beta * crank.d4


_DERIVATIVES = (_torque, _stiffness, _slope, _curvature)
