"""The odd polynomial spring."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import ClassVar

import numpy as np

from vsacli.actuators.laws.inversion import deflection_at_torque, with_sign_of
from vsacli.actuators.laws.law import SpringLaw, SpringState
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.compute.vector import is_zero
from vsacli.documents.fields import NON_NEGATIVE, POSITIVE, number


@dataclass(frozen=True)
class Polynomial(SpringLaw):
    """Spring tau = c1 phi + c3 phi^3 + c5 phi^5 + c7 phi^7 + c9 phi^9; with c1 alone, a linear spring."""

    c1: float = number(units.STIFFNESS, "linear coefficient", check=POSITIVE)
    c3: float = number(units.CUBIC_STIFFNESS, "cubic coefficient", check=NON_NEGATIVE, default=0.0)
    c5: float = number(units.FIFTH_STIFFNESS, "coefficient of phi^5", check=NON_NEGATIVE, default=0.0)
    c7: float = number(units.SEVENTH_STIFFNESS, "coefficient of phi^7", check=NON_NEGATIVE, default=0.0)
    c9: float = number(units.NINTH_STIFFNESS, "coefficient of phi^9", check=NON_NEGATIVE, default=0.0)

    examples: ClassVar = {
        "revolute": {"c1": 400, "c3": 1000, "c5": 5000},
        "prismatic": {"c1": 4000, "c3": 100000, "c5": 2e7},
    }

    @cached_property
    def _coefficients(self) -> tuple[float, ...]:
        """Coefficients of phi, phi^3, ... up to the last that is not zero."""
        coefficients = (self.c1, self.c3, self.c5, self.c7, self.c9)
        return coefficients[
            : max(
                position for position, coefficient in enumerate(coefficients, 1) if not is_zero(coefficient)
            )
        ]

    @property
    def is_linear(self) -> bool:
        """Whether all but the first coefficient vanish."""
        return len(self._coefficients) == 1

    @property
    def polynomial(self) -> tuple[float, ...]:
        """Coefficients with zeros for even powers."""
        return tuple(term for coefficient in self._coefficients for term in (coefficient, 0.0))[:-1]

    def derivatives(self, phi: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """Return derivatives as power series, alternately odd and even, which share the square."""
        squared = phi * phi
        even_parts = [
            self._even_derivative(derivative_order, squared) for derivative_order in range(order + 1)
        ]
        return tuple(
            value if derivative_order % 2 else phi * value
            for derivative_order, value in enumerate(even_parts)
        )

    def torque(self, phi: FloatArray) -> FloatArray:
        """Return the torque c1 phi + c3 phi^3 + ..."""
        return phi * self._even_derivative(0, phi * phi)

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Return the stiffness."""
        return self._even_derivative(1, phi * phi)

    def slope(self, phi: FloatArray) -> FloatArray:
        """Return the slope."""
        return phi * self._even_derivative(2, phi * phi)

    def curvature(self, phi: FloatArray) -> FloatArray:
        """Return the curvature."""
        return self._even_derivative(3, phi * phi)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the energy, the integral of the torque."""
        squared = phi * phi
        return squared * _evaluate_series(
            [coefficient / (2 * index + 2) for index, coefficient in enumerate(self._coefficients)], squared
        )

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Return the inverse, by safeguarded iteration from the least deflection of any term alone."""
        return self.deflection_and_state(torque)[0]

    def deflection_and_state(self, torque: FloatArray) -> tuple[FloatArray, SpringState]:
        """Return deflection and state by one iteration."""
        if self.is_linear:
            return torque / self.c1, self.state(torque / self.c1)
        load = np.abs(torque)
        bounds = [
            (load / coefficient) ** (1 / (2 * index + 1))
            for index, coefficient in enumerate(self._coefficients)
            if coefficient > 0
        ]
        high = reduce(np.minimum, bounds)
        return with_sign_of(torque, *deflection_at_torque(self, load, np.zeros_like(load), high, start=high))

    def _even_derivative(self, order: int, squared: FloatArray) -> FloatArray:
        """Return a derivative of the torque without the factor phi that those of even order have."""
        return _evaluate_series(self._derivative_coefficients[order], squared)

    @cached_property
    def _derivative_coefficients(self) -> list[list[float]]:
        """Coefficients of the torque and of each derivative."""
        return [
            [
                math.perm(2 * index + 1, order) * coefficient
                for index, coefficient in enumerate(self._coefficients)
            ][order // 2 :]
            for order in range(4)
        ]


def _evaluate_series(coefficients: Sequence[float], x: FloatArray) -> FloatArray:
    """Return the power series with coefficients from the constant on."""
    if not coefficients:
        return np.zeros_like(x)
    *lower, highest = coefficients
    result = np.full_like(x, highest)
    for coefficient in reversed(lower):
        result = result * x + coefficient
    return result
