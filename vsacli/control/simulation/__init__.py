"""Simulation of the full model under a controller: feedforward, or feedback linearization."""

from vsacli.control.simulation.integrator import Tolerances
from vsacli.control.simulation.perturbation import perturbed
from vsacli.control.simulation.simulate import Measured, Setup, Simulation, simulate
from vsacli.control.simulation.start import InitialError

__all__ = ["InitialError", "Measured", "Setup", "Simulation", "Tolerances", "perturbed", "simulate"]
