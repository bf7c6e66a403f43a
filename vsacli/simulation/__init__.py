"""Simulation of the full model under a controller: feedforward, or feedback linearization."""

from vsacli.simulation.integration import Tolerances
from vsacli.simulation.perturbation import perturbed
from vsacli.simulation.run import Measured, Setup, Simulation, simulate
from vsacli.simulation.start import InitialError

__all__ = ["InitialError", "Measured", "Setup", "Simulation", "Tolerances", "perturbed", "simulate"]
