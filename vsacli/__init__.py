"""Inverse dynamics of robots with variable stiffness actuators (VSA-NEA, Buondonno & De Luca 2016)."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vsacli.analysis.run import inverse_dynamics
    from vsacli.robot.file import load_robot
    from vsacli.trajectory.file import load_trajectory
    from vsacli.trajectory.trajectory import Trajectory

__version__ = "0.1.0"
__all__ = ["Trajectory", "__version__", "inverse_dynamics", "load_robot", "load_trajectory"]

_HOME = {
    "Trajectory": "vsacli.trajectory.trajectory",
    "inverse_dynamics": "vsacli.analysis.run",
    "load_robot": "vsacli.robot.file",
    "load_trajectory": "vsacli.trajectory.file",
}


def __getattr__(name: str) -> Any:
    """Import an exported name at its first use, so that the command line starts without NumPy (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)
