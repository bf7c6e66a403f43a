"""Two motors behind nonlinear springs: (14), and (61)-(72) with the decoupling matrix."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vsacli.actuation.transmission import Command, Transmission
from vsacli.arrays import BoolArray, FloatArray
from vsacli.feasibility import has, reach_flags
from vsacli.flags import Flag
from vsacli.robot import Antagonistic
from vsacli.springs import PairSolution, make_pair


class _Springs(NamedTuple):
    """Torques of the two springs and their derivatives at the deflections; arrays (2, samples)."""

    tau: FloatArray
    sigma: FloatArray
    zeta: FloatArray
    eta: FloatArray


def transmit(
    actuator: Antagonistic, command: Command, near_singular: float, followed: FloatArray | None
) -> Transmission:
    """Deflections on the actuator's branch, their rates, and motor accelerations; arguments as of `drive`."""
    solution = solve_deflections(actuator, command.tau_e, command.stiffness)
    flags = reach_flags(command.stiffness, solution, near_singular)
    phi = solution.deflections if followed is None else followed.copy()  # (61)
    flags[np.isnan(phi[0])] |= np.uint16(Flag.INFEASIBLE)
    phi[:, has(flags, Flag.INFEASIBLE)] = np.nan
    springs = _springs(actuator, phi)

    det_a = _determinant(springs)
    divisor = np.where(has(flags, Flag.SINGULAR), np.nan, det_a)
    dphi = _solve(springs, divisor, command.dtau_e, command.dstiffness)  # (68)
    return Transmission(
        stiffness=command.stiffness,
        dstiffness=command.dstiffness,
        ddstiffness=command.ddstiffness,
        phi=phi,
        dphi=dphi,
        ddtheta=_solve(springs, divisor, *_beta(springs, dphi, command)),  # (72)
        tau_spring=springs.tau,
        det_A=det_a,
        stiffness_lower=solution.lower,
        stiffness_upper=solution.upper,
        flags=flags,
    )


def solve_deflections(actuator: Antagonistic, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
    """Solve (14) on the branch that the actuator's preload names."""
    first, second = actuator.laws
    if actuator.preload == "negative":
        return make_pair(second, first).solve(tau_e, stiffness).mirrored()
    return make_pair(first, second).solve(tau_e, stiffness)


def deflection_rates(
    actuator: Antagonistic, phi: FloatArray, dtau_e: FloatArray, dstiffness: FloatArray
) -> FloatArray:
    """Rates of the deflections phi, both (2, samples), by (19)-(20)."""
    springs = _springs(actuator, phi)
    return _solve(springs, _determinant(springs), dtau_e, dstiffness)


def decoupling_determinant(actuator: Antagonistic, phi: FloatArray) -> FloatArray:
    """Determinant of A at deflections (2, samples), (67)."""
    return _determinant(_springs(actuator, phi))


def other_preload_would_do(actuator: Antagonistic, tau_e: FloatArray, stiffness: FloatArray) -> BoolArray:
    """Where the branch with the opposite preload reaches the stiffness."""
    if any(law.pulls_only for law in actuator.laws):
        return np.zeros(tau_e.shape, dtype=bool)
    opposite = replace(actuator, preload="negative" if actuator.preload == "positive" else "positive")
    return ~has(reach_flags(stiffness, solve_deflections(opposite, tau_e, stiffness)), Flag.INFEASIBLE)


def _springs(actuator: Antagonistic, phi: FloatArray) -> _Springs:
    sides = list(zip(actuator.laws, phi, strict=True))
    return _Springs(
        tau=np.stack([law.torque(deflection) for law, deflection in sides]),  # (62)
        sigma=np.stack([law.stiffness(deflection) for law, deflection in sides]),  # (63)
        zeta=np.stack([law.slope(deflection) for law, deflection in sides]),  # (64)
        eta=np.stack([law.curvature(deflection) for law, deflection in sides]),  # (66)
    )


def _determinant(springs: _Springs) -> FloatArray:
    (sigma_1, sigma_2), (zeta_1, zeta_2) = springs.sigma, springs.zeta
    determinant: FloatArray = sigma_1 * zeta_2 - sigma_2 * zeta_1  # (67)
    return determinant


def _beta(springs: _Springs, dphi: FloatArray, command: Command) -> tuple[FloatArray, FloatArray]:
    squared = dphi * dphi
    sigma, zeta = springs.sigma.sum(axis=0), springs.zeta.sum(axis=0)  # (11), (65)
    return (
        command.ddtau_e - (springs.zeta * squared).sum(axis=0) + sigma * command.ddq,  # (70)
        command.ddstiffness - (springs.eta * squared).sum(axis=0) + zeta * command.ddq,  # (71)
    )


def _solve(springs: _Springs, det_a: FloatArray, upper: FloatArray, lower: FloatArray) -> FloatArray:
    """A^-1 (upper, lower) by (67)."""
    (sigma_1, sigma_2), (zeta_1, zeta_2) = springs.sigma, springs.zeta
    return np.stack((zeta_2 * upper - sigma_2 * lower, sigma_1 * lower - zeta_1 * upper)) / det_a
