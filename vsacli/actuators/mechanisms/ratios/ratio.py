"""Levers whose rotation a spring resists, U = K(s) w(phi) with a closed solution: AwAS, AwAS-II, vsaUT-II."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from vsacli.actuators.laws.law import PairSolution, SpringRecord, SpringState
from vsacli.actuators.mechanisms.mechanism import Mechanism, Partials
from vsacli.actuators.mechanisms.ratios.scales import ScaleDerivatives
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import NON_ZERO, POSITIVE, interval, number


@dataclass(frozen=True)
class Sine(SpringRecord):
    """A softening torque tau = (k/ratio) sin(ratio phi), up to its maximum at ratio phi = pi/2."""

    k: float = number(units.STIFFNESS, "stiffness at rest", check=POSITIVE)
    ratio: float = number(
        units.DIMENSIONLESS, "angle of the sine over the deflection", check=POSITIVE, default=2.0
    )

    @property
    def domain(self) -> tuple[float, float]:
        """Deflections up to the largest torque."""
        end = math.pi / 2 / self.ratio
        return (-end, end)

    @property
    def torque_range(self) -> tuple[float, float]:
        """The largest torque to either side."""
        return (-self.k / self.ratio, self.k / self.ratio)

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Return the inverse, asin(ratio torque/k)/ratio."""
        return np.arcsin(torque * (self.ratio / self.k)) / self.ratio

    def deflection_at(self, quotient: FloatArray) -> FloatArray:
        """Return the deflection at which torque over stiffness, tan(ratio phi)/ratio, has a value."""
        return np.arctan(self.ratio * quotient) / self.ratio

    def state(self, phi: FloatArray) -> SpringState:
        """Return torque and three derivatives."""
        return self.energy_and_state(phi)[1]

    def energy_and_state(self, phi: FloatArray) -> tuple[FloatArray, SpringState]:
        """Return the energy 2 k/ratio^2 sin^2(ratio phi/2), the torque and three derivatives."""
        turn, squared = self.ratio * phi, self.ratio * self.ratio
        half = np.sin(turn / 2)
        tau, sigma = self.k / self.ratio * np.sin(turn), self.k * np.cos(turn)
        energy: FloatArray = 2 * self.k / squared * half * half
        return energy, SpringState(tau, sigma, -squared * tau, -squared * sigma)


UNIT_SINE = Sine(k=2.0, ratio=2.0)
"""g = sin 2phi, of w = sin^2(phi)."""


def ratio_partials(scale: ScaleDerivatives, energy: FloatArray, torque: SpringState) -> Partials:
    """Return the partial derivatives of the potential K(s) w(phi).

    Args:
        scale: K and two derivatives.
        energy: w.
        torque: g and three derivatives.
    """
    value, slope, curvature = scale
    return Partials(
        energy=value * energy,
        setting_torque=slope * energy,
        setting_stiffness=curvature * energy,
        T=value * torque.tau,
        T_p=value * torque.sigma,
        T_s=slope * torque.tau,
        T_pp=value * torque.zeta,
        T_ps=slope * torque.sigma,
        T_ss=curvature * torque.tau,
        T_ppp=value * torque.eta,
        T_pps=slope * torque.zeta,
        T_pss=curvature * torque.sigma,
    )


@dataclass(frozen=True)
class SineRatio(Mechanism):
    """A spring stretched by the rotation of a lever, U = K(s) sin^2(phi); never singular.

    With T = K sin 2phi and sigma = 2 K cos 2phi the solution is closed: 2K is the hypotenuse over the sides
    sigma and 2 tau_e, and 2phi the angle between it and sigma.
    """

    joint_types: ClassVar[tuple[str, ...]] = ("revolute",)

    @abstractmethod
    def scale(self, s: FloatArray) -> ScaleDerivatives:
        """Return K(s) with its derivatives, positive and monotone over the range of the setting."""

    @abstractmethod
    def setting(self, scale: FloatArray) -> FloatArray:
        """Return the setting s at which K(s) has a value."""

    @property
    @abstractmethod
    def scale_range(self) -> tuple[float, float]:
        """The smallest and the largest K."""

    def partials(self, phi: FloatArray, s: FloatArray) -> Partials:
        """Return the derivatives of K(s) sin^2(phi)."""
        return ratio_partials(self.scale(s), *UNIT_SINE.energy_and_state(phi))

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:  # noqa: ARG002
        """Solve by (2 K_min)^2 <= sigma^2 + (2 tau_e)^2 <= (2 K_max)^2, cut at sigma = 0."""
        load = 2 * np.abs(np.where(np.isfinite(tau_e), tau_e, np.nan))
        smallest_squared, largest_squared = (
            (2 * scale - load) * (2 * scale + load) for scale in self.scale_range
        )
        is_carried = largest_squared >= 0
        lower, upper = (
            np.sqrt(np.where(is_carried, np.maximum(squared, 0), np.nan))
            for squared in (smallest_squared, largest_squared)
        )
        demand = np.minimum(np.maximum(stiffness, lower), upper)
        nowhere = np.zeros_like(is_carried)
        return PairSolution(
            lower=lower,
            upper=upper,
            lower_critical=nowhere,
            upper_critical=nowhere,
            slack_below=nowhere,
            phi_1=np.arctan2(2 * tau_e, demand) / 2,
            phi_2=self.setting(np.hypot(demand, load) / 2),
        )


@dataclass(frozen=True)
class Awas(SineRatio):
    """Two springs that pull an arm of length r = lead theta_2 from either side: U = k r^2 sin^2(phi).

    Jafari, Tsagarakis, Vanderborght & Caldwell, IROS 2010.
    """

    k: float = number(units.LINEAR_STIFFNESS, "stiffness of either spring", check=POSITIVE)
    arm: tuple[float, float] = interval(units.LENGTH, "shortest and longest arm, above zero")
    lead: float = number(units.LEAD, "change of the arm length per theta_2", check=NON_ZERO)

    def _problems(self) -> Iterator[FieldProblem]:
        if not 0 < self.arm[0] < self.arm[1] < np.inf:
            yield FieldProblem(("arm",), "must have two ends above zero, the shorter one first")

    @classmethod
    def example(cls, joint_type: str) -> dict[str, Any]:  # noqa: ARG003
        """Return arms from 5 to 12 cm."""
        return {"k": 50000, "arm": [0.05, 0.12], "lead": 0.01}

    @property
    def setting_range(self) -> tuple[float, float]:
        """theta_2 at the ends of the arm; the lead, which may be a symbol, may be negative."""
        shortest, longest = (arm / self.lead for arm in self.arm)
        return np.minimum(shortest, longest), np.maximum(shortest, longest)

    @property
    def scale_range(self) -> tuple[float, float]:
        """K at the ends of the arm."""
        shortest, longest = self.arm
        return self.k * shortest * shortest, self.k * longest * longest

    def scale(self, s: FloatArray) -> ScaleDerivatives:
        """Return K = k r^2."""
        curvature = self.k * self.lead * self.lead
        return ScaleDerivatives(curvature * s * s, 2 * curvature * s, np.full_like(s, 2 * curvature))

    def setting(self, scale: FloatArray) -> FloatArray:
        """Return the arm, sqrt(K/k)."""
        return np.sqrt(scale / self.k) / self.lead


@dataclass(frozen=True)
class Lever(SineRatio):
    """A spring at one end of a lever, the link at the other, the pivot between them at p = lead theta_2.

    The lever of length L multiplies the spring force by p/(L - p): U = k/2 L^2 (p/(L - p))^2 sin^2(phi).
    Jafari, Tsagarakis & Caldwell, ICRA 2011 (AwAS-II); Groothuis, Rusticelli, Zucchelli, Stramigioli &
    Carloni, IEEE/ASME Transactions on Mechatronics 2014 (vsaUT-II).
    """

    k: float = number(units.LINEAR_STIFFNESS, "stiffness of the spring", check=POSITIVE)
    length: float = number(units.LENGTH, "length L of the lever, from the spring to the link", check=POSITIVE)
    pivot: tuple[float, float] = interval(
        units.LENGTH, "range of the pivot's distance p from the spring, above zero and below the length"
    )
    lead: float = number(units.LEAD, "displacement of the pivot per theta_2", check=NON_ZERO)

    def _problems(self) -> Iterator[FieldProblem]:
        if not 0 < self.pivot[0] < self.pivot[1] < self.length:
            reason = (
                f"must have two ends between zero and the length {self.length:g} m, the smaller one first"
            )
            yield FieldProblem(("pivot",), reason)

    @classmethod
    def example(cls, joint_type: str) -> dict[str, Any]:  # noqa: ARG003
        """Return a pivot that moves over half of a lever of 10 cm."""
        return {"k": 20000, "length": 0.1, "pivot": [0.03, 0.08], "lead": 0.01}

    @property
    def setting_range(self) -> tuple[float, float]:
        """theta_2 at the ends of the pivot's travel."""
        low, high = sorted(pivot / self.lead for pivot in self.pivot)
        return low, high

    @property
    def scale_range(self) -> tuple[float, float]:
        """K at the ends of the pivot's travel."""
        low, high = (float(self.scale(np.array(pivot / self.lead)).value) for pivot in self.pivot)
        return low, high

    def scale(self, s: FloatArray) -> ScaleDerivatives:
        """Return K = k/2 (L x)^2 with x = p/(L - p)."""
        distance = self.length - self.lead * s
        ratio, slope = self.lead * s / distance, self.length * self.lead / (distance * distance)
        factor = self.k * self.length * self.length
        # x'' is 2 x' lead/(L - p)
        curvature_factor = slope * slope + 2 * self.lead * ratio * slope / distance
        return ScaleDerivatives(factor / 2 * ratio * ratio, factor * ratio * slope, factor * curvature_factor)

    def setting(self, scale: FloatArray) -> FloatArray:
        """Return theta_2 of the pivot position, L x/(1 + x)."""
        ratio = np.sqrt(2 * scale / self.k) / self.length
        return self.length * ratio / (1 + ratio) / self.lead
