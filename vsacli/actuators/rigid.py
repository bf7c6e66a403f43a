"""One motor that moves with its joint: NEA (2), with the inertia of the motor."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vsacli.actuators.motor import Motor
from vsacli.actuators.transmission import Command, Transmission, single_motor
from vsacli.documents.fields import Record, check_fields, value


@dataclass(frozen=True)
class Rigid:
    """One motor that moves the link directly."""

    motor: Motor = value(Record(Motor), "the motor")

    no_choice = "its actuator is rigid and has no stiffness"

    commanded: ClassVar[tuple[str, ...]] = ()
    """Signals that the actuator takes, by their keys in `COMMANDED`."""

    def __post_init__(self) -> None:
        check_fields(self)


def transmit(command: Command) -> Transmission:
    """No deflection; there is no stiffness, and so no derivative of one."""
    still = np.zeros_like(command.q)
    return single_motor(
        command, stiffness=math.nan, stiffness_rates=math.nan, phi=still, dphi=still, ddtheta=command.ddq
    )
