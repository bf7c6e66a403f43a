"""Simulation of the full model under a controller: feedforward or feedback linearization."""

from vsacli.control.simulation.integrator import Tolerances
from vsacli.control.simulation.joint_tracking import GoalTolerance
from vsacli.control.simulation.perturbation import perturbed
from vsacli.control.simulation.sensors import Sensors
from vsacli.control.simulation.simulate import (
    Feedback,
    Simulation,
    SimulationRun,
    check_feedback,
    simulate,
)
from vsacli.control.simulation.start import InitialError

__all__ = [
    "Feedback",
    "GoalTolerance",
    "InitialError",
    "Sensors",
    "Simulation",
    "SimulationRun",
    "Tolerances",
    "check_feedback",
    "perturbed",
    "simulate",
]
