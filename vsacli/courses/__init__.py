"""Courses of position, stiffness and wrench, as they are declared in trajectory files."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from vsacli.courses.course import Course
from vsacli.on_demand import OnDemand
from vsacli.spec.fields import OneOf

if TYPE_CHECKING:
    from vsacli.courses.constant import WrenchConstant
    from vsacli.courses.polynomial import WrenchPolynomial
    from vsacli.courses.recorded import RecordedWrench
    from vsacli.courses.steps import WrenchSteps

WrenchCourse: TypeAlias = "WrenchPolynomial | WrenchConstant | WrenchSteps | RecordedWrench"

_POSITIONS = {
    "polynomial": "vsacli.courses.polynomial:PositionPolynomial",
    "via": "vsacli.courses.via_points:PositionVia",
    "sinusoids": "vsacli.courses.sinusoids:PositionSinusoids",
    "sequence": "vsacli.courses.sequence:PositionSequence",
    "constant": "vsacli.courses.constant:PositionConstant",
    "csv": "vsacli.courses.recorded:Recorded",
}
POSITIONS = OneOf(OnDemand(_POSITIONS))
RIGID_POSITIONS = OneOf(
    OnDemand(
        {
            **_POSITIONS,
            "polynomial": "vsacli.courses.polynomial:RigidPositionPolynomial",
            "via": "vsacli.courses.via_points:RigidPositionVia",
            "sequence": "vsacli.courses.sequence:RigidPositionSequence",
        }
    )
)
STIFFNESSES = OneOf(
    OnDemand(
        {
            "polynomial": "vsacli.courses.polynomial:StiffnessPolynomial",
            "via": "vsacli.courses.via_points:StiffnessVia",
            "steps": "vsacli.courses.steps:StiffnessSteps",
            "constant": "vsacli.courses.constant:StiffnessConstant",
            "csv": "vsacli.courses.recorded:Recorded",
        }
    )
)
WRENCHES = OneOf(
    OnDemand(
        {
            "polynomial": "vsacli.courses.polynomial:WrenchPolynomial",
            "steps": "vsacli.courses.steps:WrenchSteps",
            "constant": "vsacli.courses.constant:WrenchConstant",
            "csv": "vsacli.courses.recorded:RecordedWrench",
        }
    )
)

__all__ = ["POSITIONS", "RIGID_POSITIONS", "STIFFNESSES", "WRENCHES", "Course", "WrenchCourse"]
