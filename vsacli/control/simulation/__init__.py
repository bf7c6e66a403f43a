"""Simulation of the full model under a controller: feedforward or feedback linearization."""

from vsacli.control.simulation.integrator import Tolerances
from vsacli.control.simulation.joint_tracking import GoalTolerance
from vsacli.control.simulation.perturbation import perturbed
from vsacli.control.simulation.sensors import Sensors
from vsacli.control.simulation.simulate import InitialError, Measured, Simulation, check_measured, simulate

__all__ = [
    "GoalTolerance",
    "InitialError",
    "Measured",
    "Sensors",
    "Simulation",
    "Tolerances",
    "check_measured",
    "perturbed",
    "simulate",
]
