"""Profiles of signals in closed form; this namespace exports the simple ones."""

from vsacli.trajectory.curves.closed_form import DEGREES, VIA_DEGREES, ClosedForm, ConstantProfile
from vsacli.trajectory.curves.polynomial import RestToRest

__all__ = [
    "DEGREES",
    "VIA_DEGREES",
    "ClosedForm",
    "ConstantProfile",
    "RestToRest",
]
