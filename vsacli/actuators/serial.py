"""Serial actuators: motor 1 carries the load, motor 2 adjusts the springs: MACCEPA, AwAS, levers, cams.

The mechanism defines the potential of the springs, from which the counterparts of (14) and (61)-(72) follow.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from vsacli.actuators.actuator import PlaceholderConstants
from vsacli.actuators.drivetrain import largest_coupling
from vsacli.actuators.elasticity import Components, Elasticity, SpringTorques
from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.mechanisms import MECHANISMS
from vsacli.actuators.mechanisms.mechanism import Mechanism, MechanismState
from vsacli.actuators.motor import Motor
from vsacli.actuators.spring_elements import LeverSpring, SpringElement
from vsacli.actuators.variable_stiffness import VariableStiffness
from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.base.variables import Variable
from vsacli.documents.fields import OneOf, PairOf, RecordOf, number, value


@dataclass(frozen=True)
class Serial(VariableStiffness):
    """Motor 1 moves the link through springs that motor 2 adjusts."""

    motor: tuple[Motor, Motor] = value(
        PairOf(RecordOf(Motor)), "motor 1, which carries the load, and motor 2, which adjusts the springs"
    )
    coupled_inertia: float = number(
        units.MOTOR_INERTIA,
        "coupling inertia B_12 between the accelerations of the motors if motor 2 is mounted on motor 1; "
        "joint side of the gears, or, for a motor with side: shaft, its shaft",
        default=0.0,
    )
    mechanism: Mechanism = value(
        OneOf(MECHANISMS), "springs, and the mechanism by which motor 2 adjusts them"
    )

    branch_field = "mechanism.branch"

    def _problems(self) -> Iterator[FieldProblem]:
        first, second = (motor.inertia for motor in self.motors)
        bound = largest_coupling(first, second)
        if not abs(self.coupled_rotors) < bound:
            reason = (
                f"is {self.coupled_rotors:g} on the joint side of the gears; its size must be below "
                f"{bound:.4g}, the root of the product of both inertias, or B is not positive definite"
            )
            yield FieldProblem(("coupled_inertia",), reason)

    @classmethod
    def has_columns(cls, variable: Variable) -> list[bool]:
        """See `Actuator.has_columns`; motor 2 has no deflection."""
        return [True, False] if variable.name in {"phi", "dphi"} else super().has_columns(variable)

    @classmethod
    def example(cls, joint_type: str, mechanism: str | None = None) -> dict[str, Any]:
        """Return equal motors and the named mechanism; by default the first that drives such joints."""
        word = mechanism or next(
            name for name, mechanism_class in MECHANISMS.items() if joint_type in mechanism_class.joint_types
        )
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
        alternatives = [
            name for name, mechanism_class in MECHANISMS.items() if joint_type in mechanism_class.joint_types
        ]
        reason = f"turns about an axis, and drives no {joint_type} joint; {' or '.join(alternatives)} can"
        return FieldProblem(("mechanism", "type"), reason)

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
    def parts(self) -> tuple[Mechanism, ...]:
        """The mechanism."""
        return (self.mechanism,)

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

    def deflections(self, unknowns: FloatArray) -> FloatArray:
        """Return phi of motor 1; the second unknown is no deflection, but the position of motor 2."""
        return np.stack((unknowns[0], np.full_like(unknowns[0], np.nan)))

    def motor_positions(self, unknowns: Components, q: FloatArray) -> FloatArray:
        """Return theta_1 = phi + q, and theta_2, which is the setting."""
        return np.stack((unknowns[0] + q, unknowns[1]))

    def unknowns(self, phi: FloatArray, theta: FloatArray) -> tuple[FloatArray, ...]:
        """Return phi of motor 1 and theta_2."""
        return phi[0], theta[1]

    def springs(self, unknowns: Components, q: FloatArray) -> MechanismState:
        """Return the mechanism at a deflection and a setting."""
        return self.mechanism.state(unknowns[0], unknowns[1], q)

    @classmethod
    def elasticity(cls, actuators: Sequence[Self]) -> Elasticity:
        """Return the springs of joints whose mechanisms are equal."""
        return _MechanismElasticity(actuators[0].mechanism)

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


class _MechanismElasticity(Elasticity):
    """A mechanism at any number of joints."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism

    def ranged(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the coordinates in which the range of the mechanism is stated."""
        return np.stack(self._mechanism.ranged(theta[..., 0] - q, theta[..., 1]), axis=-1)

    def coordinates(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return phi, theta_2 and q."""
        return np.stack((theta[..., 0] - q, theta[..., 1], q), axis=-1)

    def torques(self, coordinates: FloatArray) -> SpringTorques:
        """Return the derivatives of the potential."""
        state = self.state(coordinates)
        return SpringTorques(state.tau_e, np.stack(state.tau_transmission, axis=-1))

    def energy(self, coordinates: FloatArray) -> FloatArray:
        """Return the potential."""
        return self.state(coordinates).energy

    def state(self, coordinates: FloatArray) -> MechanismState:
        """Return the potential with its derivatives."""
        return self._mechanism.state(*(coordinates[..., coordinate] for coordinate in range(3)))
