"""Excitation trajectories, planned so that records of them tell the numbers of the robot."""

from vsacli.studies.identification.excitation.plan import TRIALS, plan_excitation
from vsacli.studies.identification.excitation.plan_file import excitation_text
from vsacli.studies.identification.excitation.plan_report import Excitation
from vsacli.studies.identification.excitation.predicted_errors import USUAL_NOISE, Noise
from vsacli.studies.remedies.acceptance import ImpossibleError

__all__ = [
    "TRIALS",
    "USUAL_NOISE",
    "Excitation",
    "ImpossibleError",
    "Noise",
    "excitation_text",
    "plan_excitation",
]
