"""Excitation trajectories, planned so that recordings of them identify the parameters of the robot."""

from vsacli.studies.identification.excitation.fisher import USUAL_NOISE, Noise
from vsacli.studies.identification.excitation.plan import TRIALS, plan_excitation
from vsacli.studies.identification.excitation.plan_report import Excitation, excitation_text
from vsacli.studies.search.acceptance import ImpossibleError

__all__ = [
    "TRIALS",
    "USUAL_NOISE",
    "Excitation",
    "ImpossibleError",
    "Noise",
    "excitation_text",
    "plan_excitation",
]
