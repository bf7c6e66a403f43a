"""What is best among all that is possible: the cheapest stiffness, the fastest timing."""

from vsacli.studies.optimisation.optimise import optimize, searches
from vsacli.studies.optimisation.optimum import Optimum

__all__ = ["Optimum", "optimize", "searches"]
