"""How much everything that is computed depends on each number of the robot file."""

from vsacli.studies.sensitivities.analysis import sensitivity
from vsacli.studies.sensitivities.sensitivity_report import Sensitivity

__all__ = ["Sensitivity", "sensitivity"]
