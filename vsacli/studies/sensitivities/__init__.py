"""Sensitivity of motor torques, margins and energy to each parameter of the robot file."""

from vsacli.studies.sensitivities.analysis import analyzed, sensitivity
from vsacli.studies.sensitivities.sensitivity_report import Sensitivity
from vsacli.studies.sensitivities.slopes import SensitivityRun

__all__ = ["Sensitivity", "SensitivityRun", "analyzed", "sensitivity"]
