"""From one value to another: a polynomial."""

from __future__ import annotations

from dataclasses import dataclass

from vsacli.base import units
from vsacli.base.signals import POSITION, STIFFNESS, WRENCH
from vsacli.documents.fields import POSITIVE, PerJoint, check_fields, integer, value, vector
from vsacli.trajectory.curves import RestToRest
from vsacli.trajectory.declared import degrees
from vsacli.trajectory.declared.course import Course, Values, numbers
from vsacli.trajectory.declared.framed import Framed


class Polynomial(Course):
    """From one value to another, at rest before and after."""

    degree: int
    start: Values
    end: Values

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> RestToRest:
        """The profile from the first to the last time of a span, in s."""
        start, end = numbers(self.start), numbers(self.end)
        return RestToRest(signal=self.signal, span=span, degree=self.degree, start=start, end=end)


@dataclass(frozen=True)
class PositionPolynomial(Polynomial):
    """Rest to rest: all derivatives up to (degree-1)/2 vanish at both ends."""

    signal = POSITION
    degree: int = integer(
        "degree of the polynomial; from 3 on if all joints are rigid", check=degrees.POSITION
    )
    start: tuple[float, ...] = value(PerJoint(units.POSITION), "position at the start")
    end: tuple[float, ...] = value(PerJoint(units.POSITION), "position at the end")


@dataclass(frozen=True)
class RigidPositionPolynomial(PositionPolynomial):
    """The same for a robot whose joints are all rigid: its torques do not depend on jerk and snap."""

    degree: int = integer("degree of the polynomial", check=degrees.RIGID_POSITION)


@dataclass(frozen=True)
class StiffnessPolynomial(Polynomial):
    """From one stiffness to another: all derivatives up to (degree-1)/2 vanish at both ends."""

    signal = STIFFNESS
    degree: int = integer("degree of the polynomial, odd, 3 to 15", check=degrees.STIFFNESS)
    start: Values = value(PerJoint(units.STIFFNESS), "stiffness at the start", check=POSITIVE)
    end: Values = value(PerJoint(units.STIFFNESS), "stiffness at the end", check=POSITIVE)


@dataclass(frozen=True)
class WrenchPolynomial(Polynomial, Framed):
    """From one wrench to another: all derivatives up to (degree-1)/2 vanish at both ends."""

    signal = WRENCH
    degree: int = integer("degree of the polynomial, odd, 3 to 15", check=degrees.WRENCH)
    start: tuple[float, ...] = vector(6, units.WRENCH, "wrench at the start, `[fx, fy, fz, mx, my, mz]`")
    end: tuple[float, ...] = vector(6, units.WRENCH, "wrench at the end")
