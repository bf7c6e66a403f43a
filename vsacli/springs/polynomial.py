"""The odd polynomial spring."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import Polynomial as Series

from vsacli import units
from vsacli.arrays import FloatArray
from vsacli.spec.fields import NON_NEGATIVE, POSITIVE, number
from vsacli.springs.inversion import inverse
from vsacli.springs.law import SpringLaw


@dataclass(frozen=True)
class Polynomial(SpringLaw):
    """tau = c1 phi + c3 phi^3 + c5 phi^5 + c7 phi^7 + c9 phi^9; with c1 alone it is a linear spring."""

    c1: float = number(units.STIFFNESS, "linear coefficient", check=POSITIVE)
    c3: float = number(units.CUBIC_STIFFNESS, "cubic coefficient", check=NON_NEGATIVE, default=0.0)
    c5: float = number(units.FIFTH_STIFFNESS, "coefficient of phi^5", check=NON_NEGATIVE, default=0.0)
    c7: float = number(units.SEVENTH_STIFFNESS, "coefficient of phi^7", check=NON_NEGATIVE, default=0.0)
    c9: float = number(units.NINTH_STIFFNESS, "coefficient of phi^9", check=NON_NEGATIVE, default=0.0)

    @cached_property
    def _derivatives(self) -> tuple[Series, Series, Series, Series]:
        odd = np.zeros(10)
        odd[1::2] = self._coefficients
        series = Series(np.trim_zeros(odd, "b"))
        return series, series.deriv(1), series.deriv(2), series.deriv(3)

    @property
    def is_linear(self) -> bool:
        """Whether all but the first coefficient vanish."""
        return not any(self._coefficients[1:])

    @property
    def _coefficients(self) -> tuple[float, ...]:
        return (self.c1, self.c3, self.c5, self.c7, self.c9)

    @cached_property
    def hardening_peak(self) -> tuple[float, float]:
        """Torques at the first root of rho' = (eta sigma - zeta^2)/sigma^2."""
        _, sigma, zeta, eta = self._derivatives
        roots = (eta * sigma - zeta * zeta).roots()
        positive = roots.real[(np.abs(roots.imag) <= 1e-6 * np.abs(roots)) & (roots.real > 0)]
        peak = float(self.torque(positive.min())) if positive.size else math.inf
        return (-peak, peak)

    def torque(self, phi: FloatArray) -> FloatArray:
        """Torque c1 phi + c3 phi^3 + ..."""
        return self._evaluate(0, phi)

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Stiffness, the first derivative."""
        return self._evaluate(1, phi)

    def slope(self, phi: FloatArray) -> FloatArray:
        """Slope, the second derivative."""
        return self._evaluate(2, phi)

    def curvature(self, phi: FloatArray) -> FloatArray:
        """Curvature, the third derivative."""
        return self._evaluate(3, phi)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Energy, the integral of the torque."""
        energy: FloatArray = self._derivatives[0].integ()(phi)
        return energy

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Inverse by safeguarded iteration from the bound that each term alone sets."""
        load = np.abs(torque)
        bounds = [
            (load / coefficient) ** (1 / (2 * index + 1))
            for index, coefficient in enumerate(self._coefficients)
            if coefficient > 0
        ]
        high = np.minimum.reduce(bounds)
        return np.copysign(inverse(self, load, np.zeros_like(load), high, start=high), torque)

    def _evaluate(self, order: int, phi: FloatArray) -> FloatArray:
        result: FloatArray = self._derivatives[order](phi)
        return result
