"""From link torque to motor torque, (61)-(74), for one joint over samples; the actuator decides how."""

from vsacli.actuation.antagonistic import (
    decoupling_determinant,
    deflection_rates,
    other_preload_would_do,
    solve_deflections,
)
from vsacli.actuation.drive import Drive, drive
from vsacli.actuation.transmission import Command

__all__ = [
    "Command",
    "Drive",
    "decoupling_determinant",
    "deflection_rates",
    "drive",
    "other_preload_would_do",
    "solve_deflections",
]
