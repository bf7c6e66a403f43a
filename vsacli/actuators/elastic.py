"""One motor behind a spring of constant stiffness: EJ-NEA, Buondonno & De Luca (2015)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from vsacli.actuators.actuator import Actuator, Carried, PlaceholderConstants
from vsacli.actuators.elasticity import Elasticity, ElasticState, Torques
from vsacli.actuators.limit_check import OfJoint
from vsacli.actuators.motor import JointMotor, Motor
from vsacli.actuators.transmission import Command, Transmission, single_motor
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.documents.fields import POSITIVE, Record, check_fields, number, value

EXAMPLE_STIFFNESS = {"revolute": 1000, "prismatic": 10000}


@dataclass(frozen=True)
class Elastic(Actuator):
    """One motor that moves the link through a spring of constant stiffness."""

    motor: Motor = value(Record(Motor), "the motor")
    stiffness: float = number(units.STIFFNESS, "stiffness of the transmission", check=POSITIVE)

    uncommanded: ClassVar[Mapping[str, str]] = {
        "stiffness": "its actuator is elastic, with the constant stiffness that the robot file says"
    }

    def __post_init__(self) -> None:
        check_fields(self)

    @classmethod
    def example(cls, joint_type: str) -> dict[str, Any]:
        """A motor and a spring."""
        return {"motor": Motor.example(joint_type), "stiffness": EXAMPLE_STIFFNESS[joint_type]}

    @classmethod
    def placeholder(cls, constants: PlaceholderConstants) -> Self:
        """One motor, which drives the joint alone."""
        return cls(motor=constants.only_motor, stiffness=constants.stiffness)

    @property
    def motors(self) -> tuple[JointMotor, ...]:
        """The one motor."""
        return (self.motor.at_joint,)

    def transmit(
        self, command: Command, _near_singular: float, _integrated: FloatArray | None
    ) -> Transmission:
        """Deflection tau_e/K, and its derivatives."""
        stiffness = self.stiffness
        return single_motor(
            command,
            stiffness=stiffness,
            stiffness_rates=0.0,
            phi=command.tau_e / stiffness,
            dphi=command.dtau_e / stiffness,
            ddtheta=command.ddq + command.ddtau_e / stiffness,
        )

    def spring_rates(self, of_joint: OfJoint) -> FloatArray:
        """K phi'."""
        rates: FloatArray = self.stiffness * of_joint["dphi"][:1]
        return rates

    def carried(self, of_joint: OfJoint) -> Carried:
        """K phi, with the stiffness K."""
        tau_e = of_joint["phi"][0] * self.stiffness
        return Carried(tau_e, np.abs(tau_e), np.full_like(tau_e, self.stiffness))

    @classmethod
    def elasticity(cls, actuators: Sequence[Self]) -> Elasticity:
        """The springs of several joints."""
        return _Springs(np.array([[actuator.stiffness] for actuator in actuators]))


class _Springs(Elasticity):
    """Springs of constant stiffness, (joints, 1)."""

    def __init__(self, stiffness: FloatArray) -> None:
        self._stiffness = stiffness

    def torques(self, phi: FloatArray) -> Torques:
        """K phi."""
        tau = phi * self._stiffness
        return Torques(tau[..., 0], tau)

    def energy(self, phi: FloatArray) -> FloatArray:
        """K phi^2/2."""
        energy: FloatArray = (phi * phi * (self._stiffness / 2))[..., 0]
        return energy

    def state(self, phi: FloatArray) -> ElasticState:
        """K phi, whose derivatives are constants."""
        return _State(phi, self._stiffness)


class _State(ElasticState):
    """Springs of constant stiffness, (joints, 1), at phi."""

    def __init__(self, phi: FloatArray, stiffness: FloatArray) -> None:
        self._stiffness = stiffness
        self._torque = phi * stiffness

    @property
    def tau_e(self) -> FloatArray:
        """K phi."""
        tau_e: FloatArray = self._torque[..., 0]
        return tau_e

    @property
    def stiffness(self) -> FloatArray:
        """K."""
        return np.broadcast_to(self._stiffness[:, 0], self._torque.shape[:-1])

    @property
    def tau_spring(self) -> FloatArray:
        """K phi."""
        return self._torque

    def torque_rate(self, dphi: FloatArray) -> FloatArray:
        """K phi'."""
        rate: FloatArray = (self._stiffness * dphi)[..., 0]
        return rate

    def stiffness_rate(self, dphi: FloatArray) -> FloatArray:
        """None."""
        return np.zeros_like(dphi[..., 0])

    def motor_accelerations(
        self, _dphi: FloatArray, ddq: FloatArray, ddtau_e: FloatArray, _ddstiffness: FloatArray
    ) -> FloatArray:
        """tau_e''/K + q'', (70) alone."""
        return (ddtau_e / self.stiffness + ddq)[..., None]
