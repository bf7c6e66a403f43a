"""Export of a robot to other programs: kinematics and bodies, and motors and springs where supported."""

from __future__ import annotations

from vsacli.base.lazy import LazyRegistry

FORMATS = LazyRegistry(
    {
        "urdf": "vsacli.robot.models.urdf:urdf_model",
        "mjcf": "vsacli.robot.models.mjcf:mjcf_model",
    }
)
"""Formats by their names on the command line: functions from a robot, and the `Start` of a motion or None, to
an `ExportedModel`."""
