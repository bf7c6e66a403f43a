"""Inverse dynamics of robots with variable stiffness actuators (VSA-NEA, Buondonno & De Luca 2016)."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vsacli.actuators import laws
    from vsacli.actuators.antagonistic import Antagonistic
    from vsacli.actuators.elastic import Elastic
    from vsacli.actuators.motor import Motor
    from vsacli.actuators.rigid import Rigid
    from vsacli.analysis.report import Report
    from vsacli.analysis.result import Result
    from vsacli.analysis.result_file import open_result
    from vsacli.analysis.run import inverse_dynamics
    from vsacli.base.errors import InputError, StorageError
    from vsacli.base.flags import Flag
    from vsacli.base.wrench import Wrench
    from vsacli.control.feedback_linearization import FeedbackLinearization, feedback_linearization
    from vsacli.control.gains import Gains, Integral
    from vsacli.control.simulation.integrator import Tolerances
    from vsacli.control.simulation.perturbation import perturbed
    from vsacli.control.simulation.simulate import InitialError, simulate
    from vsacli.dynamics.forward import State, mass_matrix, state_derivative
    from vsacli.dynamics.link_torques import link_torques
    from vsacli.robot.file import load_robot
    from vsacli.robot.kinematics import forward_kinematics, jacobian
    from vsacli.robot.model import DenavitHartenberg, Inertia, Joint, Limits, Link, Pose, Robot
    from vsacli.robot.urdf import Placeholders, import_urdf
    from vsacli.studies.remedies import suggest
    from vsacli.trajectory.file import load_trajectory
    from vsacli.trajectory.motion import Motion
    from vsacli.trajectory.trajectory import Trajectory

__version__ = "0.1.0"
__all__ = [
    "Antagonistic",
    "DenavitHartenberg",
    "Elastic",
    "FeedbackLinearization",
    "Flag",
    "Gains",
    "Inertia",
    "InitialError",
    "InputError",
    "Integral",
    "Joint",
    "Limits",
    "Link",
    "Motion",
    "Motor",
    "Placeholders",
    "Pose",
    "Report",
    "Result",
    "Rigid",
    "Robot",
    "State",
    "StorageError",
    "Tolerances",
    "Trajectory",
    "Wrench",
    "__version__",
    "feedback_linearization",
    "forward_kinematics",
    "import_urdf",
    "inverse_dynamics",
    "jacobian",
    "laws",
    "link_torques",
    "load_robot",
    "load_trajectory",
    "mass_matrix",
    "open_result",
    "perturbed",
    "simulate",
    "state_derivative",
    "suggest",
]

_HOME = {
    "Antagonistic": "actuators.antagonistic",
    "DenavitHartenberg": "robot.model",
    "Elastic": "actuators.elastic",
    "FeedbackLinearization": "control.feedback_linearization",
    "Flag": "base.flags",
    "Gains": "control.gains",
    "Inertia": "robot.model",
    "InitialError": "control.simulation.simulate",
    "InputError": "base.errors",
    "Integral": "control.gains",
    "Joint": "robot.model",
    "Limits": "robot.model",
    "Link": "robot.model",
    "Motion": "trajectory.motion",
    "Motor": "actuators.motor",
    "Placeholders": "robot.urdf",
    "Pose": "robot.model",
    "Report": "analysis.report",
    "Result": "analysis.result",
    "Rigid": "actuators.rigid",
    "Robot": "robot.model",
    "State": "dynamics.forward",
    "StorageError": "base.errors",
    "Tolerances": "control.simulation.integrator",
    "Trajectory": "trajectory.trajectory",
    "Wrench": "base.wrench",
    "feedback_linearization": "control.feedback_linearization",
    "forward_kinematics": "robot.kinematics",
    "import_urdf": "robot.urdf",
    "inverse_dynamics": "analysis.run",
    "jacobian": "robot.kinematics",
    "laws": "actuators.laws",
    "link_torques": "dynamics.link_torques",
    "load_robot": "robot.file",
    "load_trajectory": "trajectory.file",
    "mass_matrix": "dynamics.forward",
    "open_result": "analysis.result_file",
    "perturbed": "control.simulation.perturbation",
    "simulate": "control.simulation.simulate",
    "state_derivative": "dynamics.forward",
    "suggest": "studies.remedies",
}
"""The module in which each exported name is at home; `laws` is one itself."""


def __getattr__(name: str) -> Any:
    """Import an exported name at its first use, so that the command line starts without NumPy (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(f"{__name__}.{_HOME[name]}")
    return module if name == "laws" else getattr(module, name)


def __dir__() -> list[str]:
    return sorted(__all__)
