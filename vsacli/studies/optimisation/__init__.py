"""What is best among all that is possible: the stiffness with which a motion costs least."""

from vsacli.studies.optimisation.optimise import SEARCHES, chosen_joints, optimize
from vsacli.studies.optimisation.optimum import Optimum

__all__ = ["SEARCHES", "Optimum", "chosen_joints", "optimize"]
