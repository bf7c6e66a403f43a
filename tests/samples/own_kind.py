"""A kind of actuator of one's own: a spring at the end of an arm whose length a second motor sets.

U(q, theta_1, theta_2) = K phi^2/2 with phi = theta_1 - q and K = k theta_2^2: motor 1 carries the whole load,
motor 2 sets the stiffness and feels what the stretched spring does to its arm. All is in closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from vsacli.actuators.actuator import Actuator, Carried, PlaceholderConstants
from vsacli.actuators.elasticity import Elasticity, ElasticState, Torques
from vsacli.actuators.laws.pair import PairSolution
from vsacli.actuators.limit_check import OfJoint
from vsacli.actuators.motor import JointMotor, Motor
from vsacli.actuators.reach import reach
from vsacli.actuators.transmission import Command, Transmission
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.variables import Variable
from vsacli.documents.fields import POSITIVE, Pair, Record, check_fields, interval, number, value


@dataclass(frozen=True)
class AdjustableArm(Actuator):
    """A spring on an arm: motor 1 turns the arm, motor 2 makes it longer."""

    motor: tuple[Motor, Motor] = value(Pair(Record(Motor)), "motor of the arm, and of its length")
    k: float = number(units.STIFFNESS, "stiffness where theta_2 is 1", check=POSITIVE)
    range: tuple[float, float] = interval(units.POSITION, "theta_2 that the arm allows, above zero")

    motor_count = 2
    commanded = ("stiffness",)

    def __post_init__(self) -> None:
        check_fields(self)

    @classmethod
    def has(cls, variable: Variable) -> list[bool]:
        """Motor 2 has no deflection."""
        return [True, False] if variable.name in {"phi", "dphi"} else super().has(variable)

    @classmethod
    def example(cls, joint_type: str) -> dict[str, Any]:
        return {"motor": Motor.example(joint_type), "k": 80, "range": [1, 10]}

    @classmethod
    def placeholder(cls, constants: PlaceholderConstants) -> Self:
        motor = Motor(inertia=constants.motor_inertia)
        return cls(motor=(motor, motor), k=constants.stiffness / 10, range=(1.0, 10.0))

    @property
    def motors(self) -> tuple[JointMotor, ...]:
        return tuple(motor.at_joint for motor in self.motor)

    @property
    def phi_ranges(self) -> tuple[tuple[float, float], ...]:
        return (-np.inf, np.inf), self.range

    def motor_positions(self, phi: FloatArray, q: FloatArray) -> FloatArray:
        return np.stack((phi[0] + q, phi[1]))

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, _q: FloatArray) -> PairSolution:
        low, high = (np.full_like(tau_e, self.k * end * end) for end in self.range)
        never = np.zeros_like(tau_e, dtype=bool)
        return PairSolution(low, high, never, never, never, tau_e / stiffness, np.sqrt(stiffness / self.k))

    def transmit(self, command: Command, near_singular: float, _: FloatArray | None) -> Transmission:
        sigma, dsigma, ddsigma = (
            command.commanded[name] for name in ("stiffness", "dstiffness", "ddstiffness")
        )
        solution = self.solve(command.tau_e, sigma, command.q)
        reached = reach(sigma, solution, near_singular)
        phi, s = (np.where(reached.infeasible, np.nan, each) for each in (solution.phi_1, solution.phi_2))
        ds = dsigma / (2 * self.k * s)
        dds = (ddsigma / (2 * self.k) - ds * ds) / s
        dphi = (command.dtau_e - dsigma * phi) / sigma
        ddphi = (command.ddtau_e - ddsigma * phi - 2 * dsigma * dphi) / sigma
        return Transmission(
            stiffness=sigma,
            dstiffness=dsigma,
            ddstiffness=ddsigma,
            phi=np.stack((phi, s)),
            dphi=np.stack((dphi, ds)),
            ddtheta=np.stack((ddphi + command.ddq, dds)),
            tau_spring=np.stack((sigma * phi, self.k * s * phi * phi)),
            elastic_energy=sigma * phi * phi / 2,
            det_A=2 * self.k * s * sigma,
            stiffness_lower=solution.lower,
            stiffness_upper=solution.upper,
            flags=reached.flags,
        )

    def spring_rates(self, of_joint: OfJoint) -> FloatArray:
        phi, dphi, s, ds = (
            of_joint[name][motor] for motor, name in ((0, "phi"), (0, "dphi"), (1, "theta"), (1, "dtheta"))
        )
        return np.stack((of_joint["dtau_e"], self.k * phi * (ds * phi + 2 * s * dphi)))

    def carried(self, of_joint: OfJoint) -> Carried:
        stiffness = self.k * of_joint["theta"][1] ** 2
        tau_e = stiffness * of_joint["phi"][0]
        return Carried(tau_e, np.abs(tau_e), stiffness)

    @classmethod
    def elasticity(cls, actuators: Sequence[Self]) -> Elasticity:
        return ArmSprings(np.array([each.k for each in actuators]))


class ArmSprings(Elasticity):
    """phi is the deflection of the arm, and theta_2."""

    def __init__(self, k: FloatArray) -> None:
        self._k = k

    def deflections(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        return np.stack((theta[..., 0] - q, theta[..., 1]), axis=-1)

    def torques(self, phi: FloatArray) -> Torques:
        state = self.state(phi)
        return Torques(state.tau_e, state.tau_spring)

    def energy(self, phi: FloatArray) -> FloatArray:
        return self._k * (phi[..., 1] * phi[..., 0]) ** 2 / 2

    def state(self, phi: FloatArray) -> ElasticState:
        return ArmState(self._k, phi[..., 0], phi[..., 1])


class ArmState(ElasticState):
    """Springs at deflections and settings of the arm."""

    def __init__(self, k: FloatArray, phi: FloatArray, s: FloatArray) -> None:
        self._k, self._phi, self._s = k, phi, s

    @property
    def stiffness(self) -> FloatArray:
        return self._k * self._s * self._s

    @property
    def tau_e(self) -> FloatArray:
        return self.stiffness * self._phi

    @property
    def tau_spring(self) -> FloatArray:
        return np.stack((self.tau_e, self._k * self._s * self._phi * self._phi), axis=-1)

    def torque_rate(self, dphi: FloatArray) -> FloatArray:
        return self.stiffness * dphi[..., 0] + self.stiffness_rate(dphi) * self._phi

    def stiffness_rate(self, dphi: FloatArray) -> FloatArray:
        return 2 * self._k * self._s * dphi[..., 1]

    def motor_accelerations(
        self, dphi: FloatArray, ddq: FloatArray, ddtau_e: FloatArray, ddstiffness: FloatArray
    ) -> FloatArray:
        dds = (ddstiffness / (2 * self._k) - dphi[..., 1] * dphi[..., 1]) / self._s
        bent = ddstiffness * self._phi + 2 * self.stiffness_rate(dphi) * dphi[..., 0]
        return np.stack(((ddtau_e - bent) / self.stiffness + ddq, dds), axis=-1)

    def determinant(self) -> FloatArray:
        return 2 * self._k * self._s * self.stiffness
