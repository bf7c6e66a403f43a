"""Actuation (61)-(74) of one joint with cubic springs, one sample at a time, in plain scalar arithmetic.

The branch is found by walking along the curve tau_1 + tau_2 = tau_e from large preload inwards in small steps
of phi_1, phi_2 from a bracketing root finder at each of them, until the joint stiffness stops falling. The
walk begins where side 1 carries three times tau_e; that critical points lie further in is all it assumes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

NODES = 150
"""Steps of the walk from one end of the curve to the other."""


@dataclass(frozen=True)
class Side:
    """One motor with its spring tau = k phi + k_c phi^3."""

    k: float
    k_c: float
    inertia: float = 1.0
    damping: float = 0.0

    def tau(self, phi: float) -> float:
        return self.k * phi + self.k_c * phi**3

    def sigma(self, phi: float) -> float:
        return self.k + 3 * self.k_c * phi**2

    def zeta(self, phi: float) -> float:
        return 6 * self.k_c * phi

    def eta(self) -> float:
        return 6 * self.k_c

    def phi(self, tau: float) -> float:
        """The deflection of a torque: |phi| is at most |tau|/k."""
        if tau == 0:
            return 0.0
        bound = 1.001 * abs(tau) / self.k
        return root(lambda phi: self.tau(phi) - tau, -bound, bound)


@dataclass(frozen=True)
class Actuation:
    """What the two motors do; `lower` is the least stiffness on the branch, the rest NaN if it is not met."""

    lower: float
    phi: Sequence[float]
    dphi: Sequence[float]
    theta: Sequence[float]
    dtheta: Sequence[float]
    ddtheta: Sequence[float]
    tau_transmission: Sequence[float]
    tau_motor: Sequence[float]
    det_a: float


@dataclass(frozen=True)
class Curve:
    """Deflections at which two sides carry tau_e together; `branch` is +1 (phi_1 up) or -1."""

    sides: tuple[Side, Side]
    tau_e: float
    branch: int = 1

    def other(self, phi: float) -> float:
        """phi_2 for phi_1."""
        first, second = self.sides
        return second.phi(self.tau_e - first.tau(phi))

    def stiffness(self, phi: float) -> float:
        """Joint stiffness G over phi_1."""
        first, second = self.sides
        return first.sigma(phi) + second.sigma(self.other(phi))

    def rise(self, phi: float) -> float:
        """A number of the sign of dG/dphi_1 towards larger preload."""
        first, second = self.sides
        other = self.other(phi)
        return self.branch * (second.sigma(other) * first.zeta(phi) - first.sigma(phi) * second.zeta(other))

    def fold(self, nodes: int = NODES) -> float:
        """phi_1 where the stiffness first stops falling on the way in from large preload."""
        first, _ = self.sides
        reach = max(abs(first.phi(3 * self.tau_e)), 1e-3)
        outer = self.branch * reach
        for step in range(1, nodes + 1):
            inner = self.branch * reach * (1 - 2 * step / nodes)
            if self.rise(inner) <= 0:
                return root(self.rise, inner, outer)
            outer = inner
        raise AssertionError("the walk met no critical point")

    def solve(self, stiffness: float, fold: float) -> float:
        """phi_1 beyond the fold for a stiffness that is reached there."""
        step = 0.1
        while self.stiffness(fold + self.branch * step) < stiffness:
            step *= 2
        return root(lambda phi: self.stiffness(phi) - stiffness, fold, fold + self.branch * step)


def root(function: Callable[[float], float], low: float, high: float) -> float:
    """A root between two points where the function has opposite signs."""
    return float(brentq(function, low, high, xtol=1e-300, rtol=4 * np.finfo(float).eps))


def actuation(
    curve: Curve, position: Sequence[float], stiffness: Sequence[float], torque_rates: Sequence[float]
) -> Actuation:
    """(61)-(74) of one sample.

    Args:
        curve: the springs under tau_e.
        position: q, dq, ddq.
        stiffness: sigma, dsigma, ddsigma.
        torque_rates: dtau_e, ddtau_e.
    """
    fold = curve.fold()
    lower = curve.stiffness(fold)
    if stiffness[0] < lower:
        nothing = (math.nan, math.nan)
        return Actuation(lower, *(nothing,) * 7, math.nan)
    q, dq, ddq = position
    sides = curve.sides
    phi_1 = curve.solve(stiffness[0], fold)
    phi = (phi_1, curve.other(phi_1))

    sigma = [side.sigma(deflection) for side, deflection in zip(sides, phi, strict=True)]
    zeta = [side.zeta(deflection) for side, deflection in zip(sides, phi, strict=True)]
    matrix = np.array([sigma, zeta])
    dphi = np.linalg.solve(matrix, [torque_rates[0], stiffness[1]])
    beta_1 = torque_rates[1] - zeta[0] * dphi[0] ** 2 - zeta[1] * dphi[1] ** 2 + (sigma[0] + sigma[1]) * ddq
    beta_2 = stiffness[2] + (zeta[0] + zeta[1]) * ddq
    beta_2 -= sides[0].eta() * dphi[0] ** 2 + sides[1].eta() * dphi[1] ** 2
    ddtheta = np.linalg.solve(matrix, [beta_1, beta_2])

    tau_transmission = [side.tau(deflection) for side, deflection in zip(sides, phi, strict=True)]
    tau_motor = [
        side.inertia * ddtheta[k] + side.damping * (dphi[k] + dq) + tau_transmission[k]
        for k, side in enumerate(sides)
    ]
    return Actuation(
        lower=lower,
        phi=phi,
        dphi=dphi,
        theta=[deflection + q for deflection in phi],
        dtheta=dphi + dq,
        ddtheta=ddtheta,
        tau_transmission=tau_transmission,
        tau_motor=tau_motor,
        det_a=sigma[0] * zeta[1] - sigma[1] * zeta[0],
    )
