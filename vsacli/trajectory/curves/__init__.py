"""Courses of position, stiffness and wrench over time, in closed form: here the simple ones."""

from vsacli.trajectory.curves.closed_form import ClosedForm
from vsacli.trajectory.curves.constant import Constant
from vsacli.trajectory.curves.curve_degrees import DEGREES, VIA_DEGREES
from vsacli.trajectory.curves.rest_to_rest import RestToRest

__all__ = [
    "DEGREES",
    "VIA_DEGREES",
    "ClosedForm",
    "Constant",
    "RestToRest",
]
