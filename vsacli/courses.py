"""Courses of position, stiffness and wrench, as they are declared in trajectory files."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

from vsacli import profiles, units
from vsacli.spec.fields import (
    POSITIVE,
    Check,
    OneOf,
    PerJoint,
    check_fields,
    choice,
    integer,
    text,
    value,
    vector,
)
from vsacli.trajectory import Profile
from vsacli.wrench import WRENCH_FRAMES

_RIGID_DEGREE = Check(
    lambda degree: degree in profiles.DEGREES,
    "odd, 3 to 15 (the motion must be twice differentiable, so its velocity must vanish at the ends)",
)
_POSITION_DEGREE = Check(
    lambda degree: degree in profiles.DEGREES and degree >= 7,
    "odd, 7 to 15 (the motion must be four times differentiable,"
    " so all derivatives up to the third must vanish at the ends)",
)
_STIFFNESS_DEGREE = Check(
    lambda degree: degree in profiles.DEGREES,
    "odd, 3 to 15 (the stiffness must be twice differentiable, so its rate must vanish at the ends)",
)
_WRENCH_DEGREE = Check(
    lambda degree: degree in profiles.DEGREES,
    "odd, 3 to 15 (the wrench must be twice differentiable, so its rate must vanish at the ends)",
)


Stiffnesses: TypeAlias = tuple[float | None, ...]
"""A stiffness for each joint that takes one, None for the others."""


@dataclass(frozen=True)
class PositionPolynomial:
    """Rest to rest: all derivatives up to (degree-1)/2 vanish at both ends."""

    degree: int = integer(
        "degree of the polynomial; from 3 on if all joints are rigid", check=_POSITION_DEGREE
    )
    start: tuple[float, ...] = value(PerJoint(units.POSITION), "position at the start")
    end: tuple[float, ...] = value(PerJoint(units.POSITION), "position at the end")

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> Profile:
        """The profile from the first to the last time of a span, in s."""
        return profiles.RestToRest(
            signal=profiles.POSITION, span=span, degree=self.degree, start=self.start, end=self.end
        )


@dataclass(frozen=True)
class RigidPositionPolynomial(PositionPolynomial):
    """The same for a robot whose joints are all rigid: its torques do not depend on jerk and snap."""

    degree: int = integer("degree of the polynomial", check=_RIGID_DEGREE)


@dataclass(frozen=True)
class PositionConstant:
    """The robot stands still."""

    value: tuple[float, ...] = value(PerJoint(units.POSITION), "position all the time")

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> Profile:
        """The profile from the first to the last time of a span, in s."""
        return profiles.Constant(signal=profiles.POSITION, span=span, value=self.value)


@dataclass(frozen=True)
class StiffnessPolynomial:
    """From one stiffness to another: all derivatives up to (degree-1)/2 vanish at both ends."""

    degree: int = integer("degree of the polynomial, odd, 3 to 15", check=_STIFFNESS_DEGREE)
    start: Stiffnesses = value(PerJoint(units.STIFFNESS), "stiffness at the start", check=POSITIVE)
    end: Stiffnesses = value(PerJoint(units.STIFFNESS), "stiffness at the end", check=POSITIVE)

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> Profile:
        """The profile from the first to the last time of a span, in s."""
        start, end = _numbers(self.start), _numbers(self.end)
        return profiles.RestToRest(
            signal=profiles.STIFFNESS, span=span, degree=self.degree, start=start, end=end
        )


@dataclass(frozen=True)
class StiffnessConstant:
    """The same stiffness all the time."""

    value: Stiffnesses = value(PerJoint(units.STIFFNESS), "stiffness all the time", check=POSITIVE)

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> Profile:
        """The profile from the first to the last time of a span, in s."""
        return profiles.Constant(signal=profiles.STIFFNESS, span=span, value=_numbers(self.value))


def _numbers(stiffnesses: Stiffnesses) -> tuple[float, ...]:
    return tuple(math.nan if stiffness is None else stiffness for stiffness in stiffnesses)


@dataclass(frozen=True)
class Recorded:
    """Samples from a CSV table, whose times are those of the trajectory."""

    file: str = text("path of the CSV file, relative to the trajectory file")

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class _Framed:
    frame: str = choice(WRENCH_FRAMES, "along whose axes `fx fy fz mx my mz` are given")


@dataclass(frozen=True)
class WrenchPolynomial(_Framed):
    """From one wrench to another: all derivatives up to (degree-1)/2 vanish at both ends."""

    degree: int = integer("degree of the polynomial, odd, 3 to 15", check=_WRENCH_DEGREE)
    start: tuple[float, ...] = vector(6, units.WRENCH, "wrench at the start, `[fx, fy, fz, mx, my, mz]`")
    end: tuple[float, ...] = vector(6, units.WRENCH, "wrench at the end")

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> Profile:
        """The profile from the first to the last time of a span, in s."""
        return profiles.RestToRest(
            signal=profiles.WRENCH, span=span, degree=self.degree, start=self.start, end=self.end
        )


@dataclass(frozen=True)
class WrenchConstant(_Framed):
    """The same wrench all the time."""

    value: tuple[float, ...] = vector(6, units.WRENCH, "wrench all the time, `[fx, fy, fz, mx, my, mz]`")

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> Profile:
        """The profile from the first to the last time of a span, in s."""
        return profiles.Constant(signal=profiles.WRENCH, span=span, value=self.value)


@dataclass(frozen=True)
class RecordedWrench(Recorded, _Framed):
    """Samples from a CSV table with the columns fx, fy, fz, mx, my, mz."""


PositionCourse: TypeAlias = PositionPolynomial | PositionConstant | Recorded
StiffnessCourse: TypeAlias = StiffnessPolynomial | StiffnessConstant | Recorded
WrenchCourse: TypeAlias = WrenchPolynomial | WrenchConstant | RecordedWrench

POSITIONS = OneOf({"polynomial": PositionPolynomial, "constant": PositionConstant, "csv": Recorded})
RIGID_POSITIONS = OneOf(
    {"polynomial": RigidPositionPolynomial, "constant": PositionConstant, "csv": Recorded}
)
STIFFNESSES = OneOf({"polynomial": StiffnessPolynomial, "constant": StiffnessConstant, "csv": Recorded})
WRENCHES = OneOf({"polynomial": WrenchPolynomial, "constant": WrenchConstant, "csv": RecordedWrench})
