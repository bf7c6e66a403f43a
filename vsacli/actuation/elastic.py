"""One motor behind a spring of constant stiffness: EJ-NEA, Buondonno & De Luca (2015)."""

from __future__ import annotations

from vsacli.actuation.transmission import Command, Transmission, single_motor
from vsacli.robot import Elastic


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
