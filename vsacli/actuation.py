"""From link torque to motor torque, (61)-(74), for one joint over samples."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vsacli.arrays import BoolArray, FlagArray, FloatArray
from vsacli.feasibility import NEAR_SINGULAR, has, limit_checks, limit_flags, reach_flags
from vsacli.flags import Flag
from vsacli.robot import Antagonistic, Joint
from vsacli.springs import PairSolution, make_pair


class Command(NamedTuple):
    """What a joint is asked to do and what its link demands of it; arrays (samples,), SI units."""

    q: FloatArray
    dq: FloatArray
    ddq: FloatArray
    stiffness: FloatArray
    dstiffness: FloatArray
    ddstiffness: FloatArray
    tau_e: FloatArray
    dtau_e: FloatArray
    ddtau_e: FloatArray


class Drive(NamedTuple):
    """What the actuator of a joint has to do for it; (2, samples) for the motors, else (samples,).

    The names are those of the result variables. Where a step is infeasible everything of the motors is NaN,
    where it is singular what needs the inverse of the decoupling matrix is.
    """

    phi: FloatArray
    dphi: FloatArray
    theta: FloatArray
    dtheta: FloatArray
    ddtheta: FloatArray
    tau_spring: FloatArray
    tau_motor: FloatArray
    det_A: FloatArray  # noqa: N815  (the published name)
    stiffness_lower: FloatArray
    stiffness_upper: FloatArray
    flags: FlagArray


class _Springs(NamedTuple):
    """Torques of the two springs and their derivatives at the deflections; arrays (2, samples)."""

    tau: FloatArray
    sigma: FloatArray
    zeta: FloatArray
    eta: FloatArray


def drive(
    joint: Joint,
    command: Command,
    near_singular: float = NEAR_SINGULAR,
    followed: FloatArray | None = None,
) -> Drive:
    """Motor motion and motor torques of an antagonistic joint, (61)-(74).

    Args:
        joint: the joint with its two motors and springs.
        command: commanded motion and stiffness, and the elastic torque with its two derivatives.
        near_singular: margin below which a step is near-singular.
        followed: deflections to use instead of the root of (14), (2, samples); a step where they are NaN is
            infeasible.
    """
    solution = solve_deflections(joint.actuator, command.tau_e, command.stiffness)
    flags = reach_flags(command.stiffness, solution, near_singular)
    phi = solution.deflections if followed is None else followed.copy()  # (61)
    flags[np.isnan(phi[0])] |= np.uint16(Flag.INFEASIBLE)
    phi[:, has(flags, Flag.INFEASIBLE)] = np.nan
    springs = _springs(joint.actuator, phi)

    det_a = _determinant(springs)
    divisor = np.where(has(flags, Flag.SINGULAR), np.nan, det_a)
    dphi = _solve(springs, divisor, command.dtau_e, command.dstiffness)  # (68)
    dtheta = dphi + command.dq  # (69)
    ddtheta = _solve(springs, divisor, *_beta(springs, dphi, command))  # (72)
    inertia, damping = _by_motor(joint, "inertia"), _by_motor(joint, "damping")
    tau_motor = inertia * ddtheta + damping * dtheta + springs.tau  # (73)-(74)
    values = {**command._asdict(), "phi": phi, "dtheta": dtheta, "tau_motor": tau_motor}
    for check in limit_checks(joint):
        of_joint = values[check.variable]
        flags |= limit_flags(check, of_joint if check.motor is None else of_joint[check.motor - 1])
    return Drive(
        phi=phi,
        dphi=dphi,
        theta=phi + command.q,  # (69)
        dtheta=dtheta,
        ddtheta=ddtheta,
        tau_spring=springs.tau,
        tau_motor=tau_motor,
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


def _by_motor(joint: Joint, attribute: str) -> FloatArray:
    return np.array([[getattr(motor, attribute)] for motor in joint.actuator.motor])
