"""Control: gains, feedback linearization, simulation, and C code for controllers."""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.control.gains import Gains, Integral
    from vsacli.control.linearization import FeedbackLinearization, feedback_linearization
    from vsacli.control.simulation.integrator import Tolerances
    from vsacli.control.simulation.joint_tracking import GoalTolerance
    from vsacli.control.simulation.perturbation import perturbed, simulate_perturbed
    from vsacli.control.simulation.sensors import Sensors
    from vsacli.control.simulation.simulate import simulate
    from vsacli.control.simulation.start import InitialError

__all__ = [
    "FeedbackLinearization",
    "Gains",
    "GoalTolerance",
    "InitialError",
    "Integral",
    "Sensors",
    "Tolerances",
    "feedback_linearization",
    "perturbed",
    "simulate",
    "simulate_perturbed",
]
__getattr__, __dir__ = lazy_exports(__name__)
