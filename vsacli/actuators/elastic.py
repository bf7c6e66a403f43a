"""One motor behind a spring of constant stiffness: EJ-NEA, Buondonno & De Luca (2015)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from vsacli.actuators.motor import Motor
from vsacli.actuators.transmission import Command, Transmission, single_motor
from vsacli.base import units
from vsacli.documents.fields import POSITIVE, Record, check_fields, number, value


@dataclass(frozen=True)
class Elastic:
    """One motor that moves the link through a spring of constant stiffness."""

    motor: Motor = value(Record(Motor), "the motor")
    stiffness: float = number(units.STIFFNESS, "stiffness of the transmission", check=POSITIVE)

    no_choice = "its actuator is elastic, with the constant stiffness that the robot file says"

    commanded: ClassVar[tuple[str, ...]] = ()
    """Signals that the actuator takes, by their keys in `COMMANDED`."""

    def __post_init__(self) -> None:
        check_fields(self)


def transmit(actuator: Elastic, command: Command) -> Transmission:
    """Deflection tau_e/K, and its derivatives."""
    stiffness = actuator.stiffness
    return single_motor(
        command,
        stiffness=stiffness,
        stiffness_rates=0.0,
        phi=command.tau_e / stiffness,
        dphi=command.dtau_e / stiffness,
        ddtheta=command.ddq + command.ddtau_e / stiffness,
    )
