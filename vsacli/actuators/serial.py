"""Serial actuators: motor 1 carries the load, motor 2 adjusts the springs: MACCEPA, AwAS, levers, cams.

The mechanism defines the potential of the springs, from which the counterparts of (14) and (61)-(72) follow.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from vsacli.actuators.actuator import Actuator, Carried, PlaceholderConstants
from vsacli.actuators.drivetrain import largest_coupling
from vsacli.actuators.elasticity import Elasticity, ElasticState, Torques
from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.mechanisms import MECHANISMS
from vsacli.actuators.mechanisms.mechanism import Mechanism, MechanismState
from vsacli.actuators.motor import JointMotor, Motor
from vsacli.actuators.reach import OfJoint, deflections_within_reach
from vsacli.actuators.spring_elements import LeverSpring, SpringElement
from vsacli.actuators.transmission import Command
from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.base.variables import Variable
from vsacli.documents.fields import OneOf, Pair, Record, number, value
from vsacli.documents.source import Source

SMALL_DEFLECTION = 1e-3
"""Deflection, rad (m), whose torque is large compared with rounding. The load of motor 1 passes through zero,
where the torque itself is no scale for its error."""


@dataclass(frozen=True)
class Serial(Actuator):
    """Motor 1 moves the link through springs that motor 2 adjusts."""

    motor: tuple[Motor, Motor] = value(
        Pair(Record(Motor)), "motor 1, which carries the load, and motor 2, which adjusts the springs"
    )
    coupled_inertia: float = number(
        units.MOTOR_INERTIA,
        "coupling inertia B_12 between the accelerations of the motors if motor 2 is mounted on motor 1; "
        "joint side of the gears, or, of a motor with side: shaft, its shaft",
        default=0.0,
    )
    mechanism: Mechanism = value(
        OneOf(MECHANISMS), "springs, and the mechanism by which motor 2 adjusts them"
    )

    motor_count = 2
    commanded = ("stiffness",)
    branch_field = "mechanism.branch"
    integrable = True

    def _problems(self) -> Iterator[FieldProblem]:
        first, second = (motor.inertia for motor in self.motors)
        largest = largest_coupling(first, second)
        if not abs(self.coupled_rotors) < largest:
            reason = (
                f"is {self.coupled_rotors:g} on the joint side of the gears; its size must be below "
                f"{largest:.4g}, the root of the product of both inertias, or B is not positive definite"
            )
            yield FieldProblem(("coupled_inertia",), reason)

    @classmethod
    def has(cls, variable: Variable) -> list[bool]:
        """See `Actuator.has`; motor 2 has no deflection."""
        return [True, False] if variable.name in {"phi", "dphi"} else super().has(variable)

    @classmethod
    def example(cls, joint_type: str, mechanism: str | None = None) -> dict[str, Any]:
        """Return equal motors and the named mechanism; by default the first that drives such joints."""
        word = mechanism or next(name for name, each in MECHANISMS.items() if joint_type in each.joint_types)
        example = {"type": word, **MECHANISMS[word].example(joint_type)}
        return {"motor": Motor.example(joint_type), "mechanism": example}

    @classmethod
    def placeholder(cls, constants: PlaceholderConstants) -> Self:
        """Return a linear spring, from a quarter to four times as stiff as an elastic transmission."""
        from vsacli.actuators.laws.polynomial import Polynomial
        from vsacli.actuators.mechanisms.ratios.scales import Power
        from vsacli.actuators.mechanisms.ratios.variable_ratio import VariableRatio

        motor, torque = Motor(inertia=constants.motor_inertia), Polynomial(c1=constants.stiffness)
        spring = VariableRatio(setting=(0.5, 2.0), scale=Power(exponent=2.0), torque=torque)
        return cls(motor=(motor, motor), mechanism=spring)

    def unfit_for(self, joint_type: str) -> FieldProblem | None:
        """Return the mechanism as the problem, if it rotates and the joint does not."""
        if joint_type in self.mechanism.joint_types:
            return None
        others = [name for name, each in MECHANISMS.items() if joint_type in each.joint_types]
        reason = f"turns about an axis, and drives no {joint_type} joint; {' or '.join(others)} can"
        return FieldProblem(("mechanism", "type"), reason)

    @property
    def motors(self) -> tuple[JointMotor, ...]:
        """Motors 1 and 2."""
        return tuple(motor.at_joint for motor in self.motor)

    @property
    def coupled_rotors(self) -> float:
        """Coupled inertia on the joint side: times the gear ratios, with signs, of motors on their shafts."""
        first, second = (motor.ratio_of_side for motor in self.motor)
        return self.coupled_inertia * first * second

    @property
    def phi_ranges(self) -> tuple[tuple[float, float], ...]:
        """Range of the mechanism, in its own coordinates."""
        return self.mechanism.ranges

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the mechanism."""
        return self.mechanism.warnings

    @property
    def sources(self) -> tuple[Source, ...]:
        """Files of the mechanism."""
        return self.mechanism.sources

    @property
    def spring_elements(self) -> tuple[SpringElement, ...] | None:
        """Springs of the mechanism."""
        return self.mechanism.spring_elements

    @property
    def lever_spring(self) -> LeverSpring | None:
        """Lever spring of the mechanism."""
        return self.mechanism.lever_spring

    @property
    def spring_group(self) -> Hashable:
        """See `Actuator.spring_group`; joints with equal mechanisms are computed together."""
        return self.mechanism

    def motor_positions(self, phi: FloatArray, q: FloatArray) -> FloatArray:
        """Return theta_1 = phi + q, and theta_2, which is the setting."""
        return np.stack((phi[0] + q, phi[1]))

    def transmit(self, command: Command, min_margin: float, integrated: FloatArray | None) -> OfJoint:
        """Compute deflection and setting on the mechanism's branch, their rates, and motor accelerations.

        NaN at infeasible samples; rates and accelerations, which need A^-1, also at singular ones.
        """
        stiffness, dstiffness, ddstiffness = (
            command.commanded[name] for name in ("stiffness", "dstiffness", "ddstiffness")
        )
        solution = self.solve(command.tau_e, stiffness, command.q)
        phi, reached = deflections_within_reach(stiffness, solution, min_margin, integrated)
        state = self._state(phi, command.q)
        rates = np.where(
            reached.singular[..., None], np.nan, state.rates(command.dtau_e, dstiffness, command.dq)
        )
        return {
            "stiffness": stiffness,
            "dstiffness": dstiffness,
            "ddstiffness": ddstiffness,
            "phi": phi,
            "dphi": rates[..., :2].T,
            "ddtheta": state.motor_accelerations(rates, command.ddq, command.ddtau_e, ddstiffness).T,
            "tau_transmission": state.tau_transmission.T,
            "elastic_energy": state.energy,
            "det_A": state.determinant(),
            "stiffness_min": solution.lower,
            "stiffness_max": solution.upper,
            "flags": reached.flags,
        }

    def spring_rates(self, of_joint: OfJoint) -> FloatArray:
        """Return the rates of the derivatives of the potential over theta_1 and theta_2."""
        rates = of_joint["dphi"][0], of_joint["dtheta"][1], of_joint["dq"]
        return self._state_of(of_joint).spring_rates(np.stack(rates, axis=-1)).T

    def carried(self, of_joint: OfJoint) -> Carried:
        """Return torque and stiffness of the mechanism.

        The stiffness may be a small difference of two large terms, which the last digits of phi and of the
        setting determine.
        """
        state = self._state_of(of_joint)
        rows, size = state.rows, np.abs(state.tau_e) + SMALL_DEFLECTION * state.stiffness
        turned = np.abs(rows.stiffness_1 * of_joint["phi"][0]) + np.abs(
            rows.stiffness_2 * of_joint["theta"][1]
        )
        return Carried(state.tau_e, size, state.stiffness, state.stiffness + turned, state.tau_transmission.T)

    @classmethod
    def elasticity(cls, actuators: Sequence[Self]) -> Elasticity:
        """Return the springs of joints whose mechanisms are equal."""
        return _Springs(actuators[0].mechanism)

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:
        """Return phi and theta_2 on the mechanism's branch."""
        return self.mechanism.solve(tau_e, stiffness, q)

    @property
    def opposite_branch(self) -> str | None:
        """See `Mechanism.opposite_branch`."""
        return self.mechanism.opposite_branch

    def other_branch(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> BoolArray:
        """See `Actuator.other_branch`: another branch of the mechanism."""
        return self.mechanism.other_branch(tau_e, stiffness, q)

    def deflection_rates(self, phi: FloatArray, command: Command) -> FloatArray:
        """Return A^-1 (tau_e', sigma')."""
        state = self._state(phi, command.q)
        return state.rates(command.dtau_e, command.commanded["dstiffness"], command.dq)[..., :2].T

    def determinant(self, phi: FloatArray, q: FloatArray) -> FloatArray:
        """Return det A over (theta_1, theta_2)."""
        return self._state(phi, q).determinant()

    def _state(self, phi: FloatArray, q: FloatArray) -> MechanismState:
        return self.mechanism.state(np.stack((*phi, q), axis=-1))

    def _state_of(self, of_joint: OfJoint) -> MechanismState:
        """Return the state at the motion of joint and motors."""
        return self._state(np.stack((of_joint["phi"][0], of_joint["theta"][1])), of_joint["q"])


class _Springs(Elasticity):
    """A mechanism at any number of joints."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism

    def deflections(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return phi and theta_2."""
        return np.stack((theta[..., 0] - q, theta[..., 1]), axis=-1)

    def ranged(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the coordinates in which the range of the mechanism is stated."""
        return np.stack(self._mechanism.ranged(theta[..., 0] - q, theta[..., 1]), axis=-1)

    def coordinates(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return phi, theta_2 and q."""
        return np.stack((theta[..., 0] - q, theta[..., 1], q), axis=-1)

    def torques(self, coordinates: FloatArray) -> Torques:
        """Return the derivatives of the potential."""
        state = self._mechanism.state(coordinates)
        return Torques(state.tau_e, state.tau_transmission)

    def energy(self, coordinates: FloatArray) -> FloatArray:
        """Return the potential."""
        return self._mechanism.state(coordinates).energy

    def state(self, coordinates: FloatArray) -> ElasticState:
        """Return the potential with its derivatives."""
        return self._mechanism.state(coordinates)
