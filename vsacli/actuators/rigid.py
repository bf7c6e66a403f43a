"""One motor that moves with its joint: the rigid case (1)-(2), with the inertia of the motor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from vsacli.actuators.actuator import Actuator, PlaceholderConstants
from vsacli.actuators.motor import Motor
from vsacli.actuators.transmission import Command, JointVariables, single_motor
from vsacli.base.arrays import FLAG_TYPE, FloatArray
from vsacli.documents.fields import RecordOf, value


@dataclass(frozen=True)
class Rigid(Actuator):
    """One motor that moves the link directly."""

    motor: Motor = value(RecordOf(Motor), "motor")

    sprung = False
    uncommanded: ClassVar[Mapping[str, str]] = {"stiffness": "its actuator is rigid and has no stiffness"}

    @classmethod
    def example(cls, joint_type: str, mechanism: str | None = None) -> dict[str, Any]:  # noqa: ARG003
        """Return a motor."""
        return {"motor": Motor.example(joint_type)}

    @classmethod
    def placeholder(cls, constants: PlaceholderConstants) -> Self:
        """Return one motor, which drives the joint alone."""
        return cls(motor=constants.only_motor)

    def transmit(
        self, command: Command, _min_margin: float, _prescribed: FloatArray | None
    ) -> JointVariables:
        """Return zero deflection; stiffness and its derivatives are NaN."""
        zero, absent = np.zeros_like(command.q), np.full_like(command.q, np.nan)
        return single_motor(
            command,
            stiffness=absent,
            dstiffness=absent,
            ddstiffness=absent,
            phi=zero,
            dphi=zero,
            theta=command.q,
            dtheta=command.dq,
            ddtheta=command.ddq,
            tau_transmission=command.tau_e,
            elastic_energy=zero * command.tau_e / 2,
            flags=np.zeros(zero.shape, dtype=FLAG_TYPE),
        )
