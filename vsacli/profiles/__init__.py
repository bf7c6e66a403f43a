"""Courses of position, stiffness and wrench over time, in closed form: here the simple ones."""

from vsacli.profiles.closed_form import ClosedForm
from vsacli.profiles.constant import Constant
from vsacli.profiles.degrees import DEGREES, VIA_DEGREES
from vsacli.profiles.rest_to_rest import RestToRest
from vsacli.profiles.signals import POSITION, STIFFNESS, WRENCH, Signal

__all__ = [
    "DEGREES",
    "POSITION",
    "STIFFNESS",
    "VIA_DEGREES",
    "WRENCH",
    "ClosedForm",
    "Constant",
    "RestToRest",
    "Signal",
]
