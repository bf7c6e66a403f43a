"""The four-bar transmission of the VSA-II."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsacli import units
from vsacli.arrays import FloatArray
from vsacli.spec.fields import POSITIVE, Check, number
from vsacli.springs.inversion import inverse
from vsacli.springs.law import SpringLaw

ABOVE_ONE = Check(lambda ratio: ratio > 1 and math.isfinite(ratio), "greater than 1")


class _Crank(NamedTuple):
    """Angle beta of the linear spring, and its derivatives by the deflection."""

    beta: FloatArray
    d1: FloatArray
    d2: FloatArray
    d3: FloatArray
    d4: FloatArray


@dataclass(frozen=True)
class FourBar(SpringLaw):
    """Linear spring behind a four-bar linkage: U = k beta^2/2, beta = asin(C sin(phi/2)) - phi/2, C > 1.

    The form of the VSA-II, Schiavi, Grioli, Sen & Bicchi, ICRA 2008. Its domain is |phi| < 2 asin(1/C), where
    the linkage stretches and the torque grows without bound.
    """

    k: float = number(units.TORQUE, "constant k of the linear spring, per rad of beta", check=POSITIVE)
    ratio: float = number(units.DIMENSIONLESS, "ratio C of the linkage's arms", check=ABOVE_ONE)

    @property
    def domain(self) -> tuple[float, float]:
        """Where the linkage is not yet stretched."""
        end = 2 * math.asin(1 / self.ratio)
        return (-end, end)

    def torque(self, phi: FloatArray) -> FloatArray:
        """Torque k beta beta'."""
        crank = self._crank(phi)
        return self.k * crank.beta * crank.d1

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Stiffness k (beta'^2 + beta beta'')."""
        crank = self._crank(phi)
        return self.k * (crank.d1**2 + crank.beta * crank.d2)

    def slope(self, phi: FloatArray) -> FloatArray:
        """Slope k (3 beta' beta'' + beta beta''')."""
        crank = self._crank(phi)
        return self.k * (3 * crank.d1 * crank.d2 + crank.beta * crank.d3)

    def curvature(self, phi: FloatArray) -> FloatArray:
        """Curvature k (3 beta''^2 + 4 beta' beta''' + beta beta'''')."""
        crank = self._crank(phi)
        return self.k * (3 * crank.d2**2 + 4 * crank.d1 * crank.d3 + crank.beta * crank.d4)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Energy k beta^2/2."""
        return self.k * self._crank(phi).beta ** 2 / 2

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Inverse by safeguarded iteration."""
        load = np.abs(torque)
        end = np.full_like(load, np.nextafter(self.domain[1], 0))
        return np.copysign(inverse(self, load, np.zeros_like(load), end), torque)

    def _crank(self, phi: FloatArray) -> _Crank:
        c = self.ratio
        sin, cos = np.sin(phi / 2), np.cos(phi / 2)
        sin_psi = c * sin
        room = (1 - sin_psi) * (1 + sin_psi)
        root = np.sqrt(room)
        bend = c * (c * c - 1)
        return _Crank(
            beta=np.arcsin(sin_psi) - phi / 2,
            d1=c * cos / (2 * root) - 0.5,
            d2=bend / 4 * sin / (room * root),
            d3=bend / 8 * cos * (1 + 2 * sin_psi**2) / (room**2 * root),
            d4=bend / 8 * sin * self._fourth(sin_psi, c * cos, room) / (room**3 * root),
        )

    @staticmethod
    def _fourth(sin_psi: FloatArray, c_cos: FloatArray, room: FloatArray) -> FloatArray:
        grown = 1 + 2 * sin_psi**2
        return c_cos**2 * (2 * room + 2.5 * grown) - grown * room / 2
