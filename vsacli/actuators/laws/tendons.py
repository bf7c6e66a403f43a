"""Tendons: springs that only pull, slack at zero deflection, mirrored on side 2: quadratic, exponential."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from vsacli.actuators.laws.law import (
    Pair,
    PairSolution,
    SpringLaw,
    SpringState,
    same_number,
    tendon_solution,
)
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.documents.fields import POSITIVE, number


@dataclass(frozen=True)
class Tendon(SpringLaw):
    """A law for phi >= 0; on side 2 it acts as tau_2(phi) = -tau(-phi) for phi <= 0."""

    @property
    def domain(self) -> tuple[float, float]:
        """Deflections from slack upward."""
        return (0.0, math.inf)

    @property
    def torque_range(self) -> tuple[float, float]:
        """Torques from slack upward."""
        return (0.0, math.inf)

    @property
    def pulls_only(self) -> bool:
        """A tendon cannot push."""
        return True

    def as_second(self) -> SpringLaw:
        """Return the tendon pulling downward."""
        return Mirrored(law=self.unlimited)


@dataclass(frozen=True)
class Mirrored(SpringLaw):
    """A law reflected in the origin, tau(phi) = -law.tau(-phi)."""

    law: SpringLaw = field(kw_only=True)

    @property
    def domain(self) -> tuple[float, float]:
        """The law's domain, mirrored."""
        return _mirrored_interval(self.law.domain)

    @property
    def torque_range(self) -> tuple[float, float]:
        """The law's range, mirrored."""
        return _mirrored_interval(self.law.torque_range)

    @property
    def pulls_only(self) -> bool:
        """Whether the law only pulls."""
        return self.law.pulls_only

    @property
    def polynomial(self) -> tuple[float, ...] | None:
        """Coefficients of the law, with those of even powers negated."""
        terms = self.law.polynomial
        return terms and tuple(term if power % 2 else -term for power, term in enumerate(terms, 1))

    def hardening(self, phi: FloatArray) -> FloatArray:
        """Return the hardening, odd in the deflection."""
        return -self.law.hardening(-phi)

    def derivatives(self, phi: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """Return the torque, odd in the deflection, and its derivatives, even and odd in turn."""
        values = self.law.derivatives(-phi, order)
        return tuple(
            value if derivative_order % 2 else -value for derivative_order, value in enumerate(values)
        )

    def deflection_and_state(self, torque: FloatArray) -> tuple[FloatArray, SpringState]:
        """Return deflection and state of the law at the opposite torque, mirrored."""
        phi, state = self.law.deflection_and_state(-torque)
        return -phi, _mirrored_state(state)

    def energy_and_state(self, phi: FloatArray) -> tuple[FloatArray, SpringState]:
        """Return the energy, even in the deflection."""
        energy, state = self.law.energy_and_state(-phi)
        return energy, _mirrored_state(state)

    def torque(self, phi: FloatArray) -> FloatArray:
        """Return the torque, odd in the deflection."""
        return -self.law.torque(-phi)

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Return the stiffness, even in the deflection."""
        return self.law.stiffness(-phi)

    def slope(self, phi: FloatArray) -> FloatArray:
        """Return the slope, odd in the deflection."""
        return -self.law.slope(-phi)

    def curvature(self, phi: FloatArray) -> FloatArray:
        """Return the curvature, even in the deflection."""
        return self.law.curvature(-phi)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the energy, even in the deflection."""
        return self.law.energy(-phi)

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Return the deflection, odd in the torque."""
        return -self.law.deflection(-torque)


def _mirrored_state(state: SpringState) -> SpringState:
    """Return the state with torque and slope reversed, which are odd in the deflection."""
    return state._replace(tau=-state.tau, zeta=-state.zeta)


def _mirrored_interval(interval: tuple[float, float]) -> tuple[float, float]:
    low, high = interval
    return -high, -low


@dataclass(frozen=True)
class Quadratic(Tendon):
    """Tendon tau = k phi^2 for phi >= 0; a pair behaves as an elastic joint with a stiffness of choice."""

    k: float = number(units.QUADRATIC_STIFFNESS, "quadratic coefficient k", check=POSITIVE)

    examples: ClassVar = {"revolute": {"k": 1000}, "prismatic": {"k": 100000}}

    @property
    def polynomial(self) -> tuple[float, ...]:
        """The quadratic term alone."""
        return (0.0, self.k)

    def closed_pair(self, other: SpringLaw) -> Pair | None:
        """Return the closed solution for two equal tendons; None for other laws."""
        return QuadraticTwins(self) if other == self.as_second() else None

    def hardening(self, phi: FloatArray) -> FloatArray:
        """Return the hardening 1/phi, infinite where the tendon goes slack."""
        with np.errstate(divide="ignore"):
            return 1 / np.abs(phi)

    def torque(self, phi: FloatArray) -> FloatArray:
        """Return the torque k phi^2."""
        return self.k * phi * phi

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Return the stiffness 2 k phi."""
        return 2 * self.k * phi

    def slope(self, phi: FloatArray) -> FloatArray:
        """Return the slope 2 k."""
        return np.where(np.isnan(phi), np.nan, 2 * self.k)

    def curvature(self, phi: FloatArray) -> FloatArray:
        """Return the curvature, zero."""
        return np.zeros_like(phi)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the energy k phi^3/3."""
        return self.k * phi * phi * phi / 3

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Return the inverse sqrt(tau/k)."""
        return np.sqrt(np.maximum(torque, 0) / self.k)


@dataclass(frozen=True)
class QuadraticTwins(Pair):
    """Two equal quadratic tendons: phi_1 - phi_2 = sigma/(2 k), phi_1 + phi_2 = 2 tau_e/sigma."""

    spring: Quadratic

    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) for each sample; see `Pair.solve`."""
        lower = 2 * np.sqrt(self.spring.k * np.abs(tau_e))
        demand = np.maximum(stiffness, lower)
        mean, half_spread = tau_e / demand, demand / (4 * self.spring.k)
        return tendon_solution(lower, phi_1=mean + half_spread, phi_2=mean - half_spread)


@dataclass(frozen=True)
class Exponential(Tendon):
    """Tendon tau = c (exp(a phi) - 1) for phi >= 0, so that sigma = a (tau + c)."""

    c: float = number(units.TORQUE, "torque scale c", check=POSITIVE)
    a: float = number(units.INVERSE_POSITION, "inverse deflection scale a", check=POSITIVE)

    examples: ClassVar = {"revolute": {"c": 20, "a": 5}, "prismatic": {"c": 40, "a": 25}}

    def closed_pair(self, other: SpringLaw) -> Pair | None:
        """Return the closed solution with a tendon of equal a on side 2; None for other laws."""
        second = other.law if isinstance(other, Mirrored) else None
        if isinstance(second, Exponential) and same_number(second.a, self.a):
            return ExponentialPair(self, second)
        return None

    def derivatives(self, phi: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """Return torque and stiffness, and the slope and curvature, each a times the one before."""
        torque = self.torque(phi)
        stiffness = self.a * (torque + self.c)
        return (torque, stiffness, self.a * stiffness, self.a**2 * stiffness)[: order + 1]

    def torque(self, phi: FloatArray) -> FloatArray:
        """Return the torque c (exp(a phi) - 1)."""
        return self.c * np.expm1(self.a * phi)

    def stiffness(self, phi: FloatArray) -> FloatArray:
        """Return the stiffness a (tau + c)."""
        return self.a * (self.torque(phi) + self.c)

    def slope(self, phi: FloatArray) -> FloatArray:
        """Return the slope a sigma."""
        return self.a * self.stiffness(phi)

    def curvature(self, phi: FloatArray) -> FloatArray:
        """Return the curvature a^2 sigma."""
        return self.a**2 * self.stiffness(phi)

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the energy tau/a - c phi."""
        return self.torque(phi) / self.a - self.c * phi

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Return the inverse ln(1 + tau/c)/a."""
        return np.log1p(np.maximum(torque, 0) / self.c) / self.a


@dataclass(frozen=True)
class ExponentialPair(Pair):
    """Two exponential tendons of equal a: sigma/a = tau_1 + |tau_2| + c_1 + c_2; never singular."""

    first: Exponential
    second: Exponential

    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) for each sample; see `Pair.solve`."""
        a, torque_scale = self.first.a, self.first.c + self.second.c
        lower = a * (np.abs(tau_e) + torque_scale)
        tension = np.maximum(stiffness, lower) / a - torque_scale
        return tendon_solution(
            lower,
            phi_1=self.first.deflection((tension + tau_e) / 2),
            phi_2=-self.second.deflection((tension - tau_e) / 2),
        )
