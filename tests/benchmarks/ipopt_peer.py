"""Best stiffness of a joint as a CasADi user would find it: one nonlinear program, built and solved by IPOPT.

Splines, instants, loads and attainable range are those of vsacli. The springs are solved in closed form, and
the motor torques written apart from vsacli's, which they judge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np

from vsacli import Joint
from vsacli.actuators.laws.cubic import Cubic
from vsacli.actuators.laws.tendons import Exponential
from vsacli.actuators.transmission import Command
from vsacli.studies.search.acceptance import Range

OPTIONS = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-7}}


@dataclass(frozen=True)
class Program:
    """A joint's stiffness at instants.

    Attributes:
        joint: with two equal cubic springs, or two equal exponential tendons.
        command: at the instants.
        admissible: stiffness at the instants.
        basis: the splines with two derivatives at the instants, (3, instants, coefficients).
        weights: of a mean over the instants.
        start: coefficients.
    """

    joint: Joint
    command: Command
    admissible: Range
    basis: np.ndarray
    weights: np.ndarray
    start: np.ndarray

    def solved(self) -> float:
        """Build and solve the program; the root mean square of the motor torques."""
        size = float(np.abs(self.start).max())
        begun = self.start / size
        unknowns = casadi.MX.sym("c", len(begun))
        rows = [casadi.mtimes(casadi.DM(size * each), unknowns) for each in self.basis]
        command = self.command
        given = np.stack([command.tau_e, command.dtau_e, command.ddtau_e, command.dq, command.ddq])
        torques = _torques(self.joint).map(given.shape[1])(casadi.horzcat(*rows).T, casadi.DM(given))
        cost = casadi.mtimes(casadi.sum1(torques * torques) / 2, casadi.DM(self.weights))
        scale = float(casadi.Function("cost", [unknowns], [cost])(begun))
        most = np.full(torques.numel(), self.joint.actuator.motors[0].max_torque)
        bounded = casadi.vertcat(rows[0], casadi.vec(torques)) if np.isfinite(most[0]) else rows[0]
        low, high = (
            np.append(stiffness, bound) if np.isfinite(most[0]) else stiffness
            for stiffness, bound in zip(self.admissible, (-most, most), strict=True)
        )
        program = {"x": unknowns, "f": cost / scale, "g": bounded}
        solver = casadi.nlpsol("solver", "ipopt", program, OPTIONS)
        return float(np.sqrt(scale * float(solver(x0=begun, lbg=low, ubg=high)["f"])))


def _torques(joint: Joint) -> casadi.Function:
    """Torques of both motors from (sigma, sigma', sigma'') and (tau_e, tau_e', tau_e'', q', q'')."""
    rows, given = casadi.SX.sym("rows", 3), casadi.SX.sym("given", 5)
    (sigma, dsigma, ddsigma), (tau, dtau, ddtau, dq, ddq) = casadi.vertsplit(rows), casadi.vertsplit(given)
    phi, laws = _deflections(joint, sigma, tau)
    derivatives = [law(each) for law, each in zip(laws, phi, strict=True)]
    (tau_1, s_1, e_1, c_1), (tau_2, s_2, e_2, c_2) = derivatives
    determinant = s_1 * e_2 - s_2 * e_1
    dphi = _solved(s_1, s_2, e_1, e_2, determinant, dtau, dsigma)
    right = (
        ddtau - e_1 * dphi[0] ** 2 - e_2 * dphi[1] ** 2,
        ddsigma - c_1 * dphi[0] ** 2 - c_2 * dphi[1] ** 2,
    )
    ddphi = _solved(s_1, s_2, e_1, e_2, determinant, *right)
    motor = joint.actuator.motors[0]
    torques = [
        motor.inertia * (ddq + acceleration) + motor.damping * (dq + rate) + torque
        for acceleration, rate, torque in zip(ddphi, dphi, (tau_1, tau_2), strict=True)
    ]
    return casadi.Function("torques", [rows, given], [casadi.vertcat(*torques)])


def _solved(s_1: Any, s_2: Any, e_1: Any, e_2: Any, determinant: Any, torque: Any, stiffness: Any) -> Any:
    return (e_2 * torque - s_2 * stiffness) / determinant, (s_1 * stiffness - e_1 * torque) / determinant


def _deflections(joint: Joint, sigma: Any, tau: Any) -> tuple[Any, Any]:
    """Deflections of both sides, and their laws: torque, stiffness, its slope and curvature."""
    law = joint.actuator.spring[0]
    if isinstance(law, Exponential):
        c, a = law.c, law.a
        one, two = (sigma / (a * c) + tau / c) / 2, (sigma / (a * c) - tau / c) / 2

        def pulling(phi: Any, sign: float = 1.0) -> Any:
            grown = c * casadi.exp(sign * a * phi)
            return sign * (grown - c), a * grown, sign * a**2 * grown, a**3 * grown

        return (casadi.log(one) / a, -casadi.log(two) / a), (pulling, lambda phi: pulling(phi, -1.0))
    assert isinstance(law, Cubic)
    k, k_c = law.k, law.k_c
    load = 3 * np.sqrt(3 * k_c) * tau / (sigma * casadi.sqrt(sigma))
    total = 2 * casadi.sqrt(sigma / (3 * k_c)) * casadi.sin(casadi.asin(load) / 3)
    spread = casadi.sqrt(2 * (sigma - 2 * k) / (3 * k_c) - total**2)

    def cubic(phi: Any) -> Any:
        return k * phi + k_c * phi**3, k + 3 * k_c * phi**2, 6 * k_c * phi, 6 * k_c

    return ((total + spread) / 2, (total - spread) / 2), (cubic, cubic)
