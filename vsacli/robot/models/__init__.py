"""The robot for other programs: its kinematics and bodies, and, where they know such, motors and springs."""

from __future__ import annotations

from vsacli.base.lazy import LazyRegistry

FORMATS = LazyRegistry(
    {
        "urdf": "vsacli.robot.models.urdf:urdf_model",
        "mjcf": "vsacli.robot.models.mjcf:mjcf_model",
    }
)
"""Formats by their names on a command line, each a function from a robot, and the `Start` of a
motion or None, to an `ExportedModel`."""
