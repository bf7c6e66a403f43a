"""The numbers of a robot from records of its motion: motors, springs, friction and links."""

from vsacli.studies.identification.fitted_file import fitted_text
from vsacli.studies.identification.identification import WORDS, identify
from vsacli.studies.identification.identification_report import Identification

__all__ = ["WORDS", "Identification", "fitted_text", "identify"]
