"""The lift of a cam with its derivatives, and the torque and stiffness of a spring behind it.

With the lift l(phi) and the pretension p, the spring is compressed by x = l + p, and T = k l' x. At a given
torque tau_e, x = tau_e/(k l'), so that the stiffness k (l'^2 + l'' x) is a function of the deflection alone,
G = k l'^2 + tau_e l''/l'.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import SpringState
from vsacli.base.arrays import FloatArray


class LinearInTorque(NamedTuple):
    """A function a(phi) + b(phi) tau_e, which is zero along a curve; arrays of one shape.

    Attributes:
        a: Part that does not depend on the torque.
        a_slope: Derivative of a over the deflection.
        b: Factor of the torque.
        b_slope: Derivative of b over the deflection.
    """

    a: FloatArray
    a_slope: FloatArray
    b: FloatArray
    b_slope: FloatArray

    def at(self, tau_e: FloatArray) -> FloatArray:
        """Return the function at a torque."""
        return self.a + self.b * tau_e

    def slope(self, tau_e: FloatArray) -> FloatArray:
        """Return the derivative by the deflection."""
        return self.a_slope + self.b_slope * tau_e


class Lift(NamedTuple):
    """Lift over the deflection from rest, with four derivatives; arrays of one shape.

    Attributes:
        l: Lift from its minimum, m.
        l1: First derivative, m/rad (1).
        l2: Second derivative.
        l3: Third derivative.
        l4: Fourth derivative.
    """

    l: FloatArray  # noqa: E741  (its symbol)
    l1: FloatArray
    l2: FloatArray
    l3: FloatArray
    l4: FloatArray

    def mirrored(self) -> Lift:
        """Return the lift of the mirrored cam, at the opposite deflection."""
        return self._replace(l1=-self.l1, l3=-self.l3)

    def after(self, step: FloatArray) -> Lift:
        """Return the lift after a short step of the deflection, by Taylor expansion."""
        half, third, fourth = step / 2, step / 3, step / 4
        return Lift(
            self.l + step * (self.l1 + half * (self.l2 + third * (self.l3 + fourth * self.l4))),
            self.l1 + step * (self.l2 + half * (self.l3 + third * self.l4)),
            self.l2 + step * (self.l3 + half * self.l4),
            self.l3 + step * self.l4,
            self.l4,
        )

    def spring(self, k: float, pretension: FloatArray | float) -> SpringState:
        """Return the torque and three derivatives over the deflection at constant pretension."""
        x = self.l + pretension
        return SpringState(
            k * self.l1 * x,
            k * (self.l1 * self.l1 + self.l2 * x),
            k * (3 * self.l1 * self.l2 + self.l3 * x),
            k * (3 * self.l2 * self.l2 + 4 * self.l1 * self.l3 + self.l4 * x),
        )

    def stiffness(self, k: float, tau_e: FloatArray) -> FloatArray:
        """Return G; at rest, where only zero torque can be carried, that of a relaxed spring."""
        at_rest = self.l1 == 0
        k_x = np.where(at_rest, 0.0, tau_e / np.where(at_rest, 1.0, self.l1))
        return k * self.l1 * self.l1 + self.l2 * k_x

    def torque_error(self, k: float, pretension: float) -> LinearInTorque:
        """Return T - tau_e, zero where the pretension carries the torque."""
        spring = self.spring(k, pretension)
        return LinearInTorque(
            spring.tau, spring.sigma, np.full_like(spring.tau, -1.0), np.zeros_like(spring.tau)
        )

    def fold_condition(self, k: float) -> LinearInTorque:
        """Return -l'^2 dG/dphi, zero at folds, where G has an extremum."""
        twice_squared = 2 * k * self.l1 * self.l1
        return LinearInTorque(
            -twice_squared * self.l1 * self.l2,
            -twice_squared * (3 * self.l2 * self.l2 + self.l1 * self.l3),
            self.l2 * self.l2 - self.l1 * self.l3,
            self.l2 * self.l3 - self.l1 * self.l4,
        )

    def torque_peak_condition(self, k: float) -> LinearInTorque:
        """Return l' G, zero where the torque has a maximum over the deflection."""
        squared = k * self.l1 * self.l1
        return LinearInTorque(squared * self.l1, 3 * squared * self.l2, self.l2, self.l3)
