"""The same value all the time."""

from __future__ import annotations

from dataclasses import dataclass

from vsacli.base import units
from vsacli.base.signals import POSITION, STIFFNESS, WRENCH
from vsacli.documents.fields import POSITIVE, PerJoint, check_fields, value, vector
from vsacli.trajectory.curves import Constant
from vsacli.trajectory.declared.course import Course, Values, numbers
from vsacli.trajectory.declared.framed import Framed


class Still(Course):
    """The same value all the time."""

    value: Values

    def __post_init__(self) -> None:
        check_fields(self)

    def over(self, span: tuple[float, float]) -> Constant:
        """The profile from the first to the last time of a span, in s."""
        return Constant(signal=self.signal, span=span, value=numbers(self.value))


@dataclass(frozen=True)
class PositionConstant(Still):
    """The robot stands still."""

    signal = POSITION
    value: tuple[float, ...] = value(PerJoint(units.POSITION), "position all the time")


@dataclass(frozen=True)
class StiffnessConstant(Still):
    """The same stiffness all the time."""

    signal = STIFFNESS
    value: Values = value(PerJoint(units.STIFFNESS), "stiffness all the time", check=POSITIVE)


@dataclass(frozen=True)
class WrenchConstant(Still, Framed):
    """The same wrench all the time."""

    signal = WRENCH
    value: tuple[float, ...] = vector(6, units.WRENCH, "wrench all the time, `[fx, fy, fz, mx, my, mz]`")
