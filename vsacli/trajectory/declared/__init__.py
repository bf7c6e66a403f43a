"""Courses of position, stiffness and wrench, as they are declared in trajectory files."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from vsacli.base.lazy import OnDemand
from vsacli.documents.fields import OneOf
from vsacli.trajectory.declared.course import Course

if TYPE_CHECKING:
    from vsacli.trajectory.declared.constant import WrenchConstant
    from vsacli.trajectory.declared.csv_samples import RecordedWrench
    from vsacli.trajectory.declared.polynomial import WrenchPolynomial
    from vsacli.trajectory.declared.steps import WrenchSteps

WrenchCourse: TypeAlias = "WrenchPolynomial | WrenchConstant | WrenchSteps | RecordedWrench"

_POSITIONS = {
    "polynomial": "vsacli.trajectory.declared.polynomial:PositionPolynomial",
    "via": "vsacli.trajectory.declared.via_points:PositionVia",
    "sinusoids": "vsacli.trajectory.declared.sinusoids:PositionSinusoids",
    "sequence": "vsacli.trajectory.declared.sequence:PositionSequence",
    "constant": "vsacli.trajectory.declared.constant:PositionConstant",
    "csv": "vsacli.trajectory.declared.csv_samples:Recorded",
}
POSITIONS = OneOf(OnDemand(_POSITIONS))
RIGID_POSITIONS = OneOf(
    OnDemand(
        {
            **_POSITIONS,
            "polynomial": "vsacli.trajectory.declared.polynomial:RigidPositionPolynomial",
            "via": "vsacli.trajectory.declared.via_points:RigidPositionVia",
            "sequence": "vsacli.trajectory.declared.sequence:RigidPositionSequence",
        }
    )
)
STIFFNESSES = OneOf(
    OnDemand(
        {
            "polynomial": "vsacli.trajectory.declared.polynomial:StiffnessPolynomial",
            "via": "vsacli.trajectory.declared.via_points:StiffnessVia",
            "steps": "vsacli.trajectory.declared.steps:StiffnessSteps",
            "constant": "vsacli.trajectory.declared.constant:StiffnessConstant",
            "csv": "vsacli.trajectory.declared.csv_samples:Recorded",
        }
    )
)
WRENCHES = OneOf(
    OnDemand(
        {
            "polynomial": "vsacli.trajectory.declared.polynomial:WrenchPolynomial",
            "steps": "vsacli.trajectory.declared.steps:WrenchSteps",
            "constant": "vsacli.trajectory.declared.constant:WrenchConstant",
            "csv": "vsacli.trajectory.declared.csv_samples:RecordedWrench",
        }
    )
)

__all__ = ["POSITIONS", "RIGID_POSITIONS", "STIFFNESSES", "WRENCHES", "Course", "WrenchCourse"]
