"""Inverse dynamics of robots with variable stiffness actuators (VSA-NEA, Buondonno & De Luca 2016)."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vsacli.pipeline import inverse_dynamics
    from vsacli.robot_file import load_robot
    from vsacli.trajectory import Trajectory
    from vsacli.trajectory_file import load_trajectory

__version__ = "0.1.0"
__all__ = ["Trajectory", "__version__", "inverse_dynamics", "load_robot", "load_trajectory"]

_HOME = {
    "Trajectory": "vsacli.trajectory",
    "inverse_dynamics": "vsacli.pipeline",
    "load_robot": "vsacli.robot_file",
    "load_trajectory": "vsacli.trajectory_file",
}


def __getattr__(name: str) -> Any:
    """Import an exported name at its first use, so that the command line starts without NumPy (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)
