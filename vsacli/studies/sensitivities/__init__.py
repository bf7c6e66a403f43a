"""How much everything that is computed depends on each number of the robot file."""

from vsacli.studies.sensitivities.analysis import analysed, sensitivity
from vsacli.studies.sensitivities.sensitivity_report import Sensitivity
from vsacli.studies.sensitivities.slopes import SensitivityRun

__all__ = ["Sensitivity", "SensitivityRun", "analysed", "sensitivity"]
