"""Commanded signals over time, declared in a file or recorded in a laboratory."""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.trajectory.file import load_trajectory
    from vsacli.trajectory.trajectory import Motion, Trajectory

__all__ = [
    "Motion",
    "Trajectory",
    "load_trajectory",
]
__getattr__, __dir__ = lazy_exports(__name__)
