"""What is best among all that is possible: the cheapest stiffness, the fastest timing."""

from vsacli.studies.optimisation.optimise import optimize, searches
from vsacli.studies.optimisation.optimum import Optimum
from vsacli.studies.optimisation.retimed import path_at

__all__ = ["Optimum", "optimize", "path_at", "searches"]
