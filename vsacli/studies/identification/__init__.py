"""Identification of a robot's parameters from recordings: motors, springs, friction and links."""

from vsacli.studies.identification.identification import WORDS, fitted_text, identify
from vsacli.studies.identification.identification_report import Identification

__all__ = ["WORDS", "Identification", "fitted_text", "identify"]
