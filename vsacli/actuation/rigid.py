"""One motor that moves with its joint: NEA (2), with the inertia of the motor."""

from __future__ import annotations

import math

import numpy as np

from vsacli.actuation.transmission import Command, Transmission, single_motor


def transmit(command: Command) -> Transmission:
    """No deflection; there is no stiffness, and so no derivative of one."""
    still = np.zeros_like(command.q)
    return single_motor(
        command, stiffness=math.nan, stiffness_rates=math.nan, phi=still, dphi=still, ddtheta=command.ddq
    )
