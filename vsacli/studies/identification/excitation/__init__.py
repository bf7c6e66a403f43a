"""Excitation trajectories, planned so that records of them tell the numbers of the robot."""

from vsacli.studies.identification.excitation.plan import plan_excitation
from vsacli.studies.identification.excitation.plan_file import excitation_text
from vsacli.studies.identification.excitation.plan_report import Excitation

__all__ = ["Excitation", "excitation_text", "plan_excitation"]
