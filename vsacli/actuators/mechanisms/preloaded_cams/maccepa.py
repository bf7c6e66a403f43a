"""MACCEPA: a spring from the lever that motor 1 turns to a point on the link, tightened by motor 2."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsacli.actuators.mechanisms.preloaded_cams.lift import Lift
from vsacli.actuators.mechanisms.preloaded_cams.preloaded_cam import PreloadedCam
from vsacli.actuators.spring_elements import LeverSpring
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import POSITIVE, check_fields, number


@dataclass(frozen=True)
class Maccepa(PreloadedCam):
    """A spring from a lever b to a point at c: U = k/2 (a - |c - b| + p)^2, a^2 = b^2 + c^2 - 2 b c cos(phi).

    Van Ham, Vanderborght, Van Damme, Verrelst & Lefeber, Robotics and Autonomous Systems 55 (2007).
    """

    b: float = number(units.LENGTH, "length of the lever that motor 1 turns", check=POSITIVE)
    c: float = number(units.LENGTH, "distance from the axis to the point of the link", check=POSITIVE)

    joint_types = ("revolute",)

    def __post_init__(self) -> None:
        problems = self._pretension_problems()
        if self.b == self.c:
            problems.append(FieldProblem(("c",), "must differ from b: levers alike have a kink at rest"))
        check_fields(self, *problems)

    @classmethod
    def example(cls, joint_type: str) -> dict[str, Any]:  # noqa: ARG003
        """Levers of a hand's size, with the stiffness of an arm's joint."""
        return {"b": 0.04, "c": 0.12, "k": 20000, "r": 0.01, "pretension": [0.002, 0.05]}

    @property
    def deflection_range(self) -> tuple[float, float]:
        """Half a turn either way."""
        return (-math.pi, math.pi)

    @property
    def lever_spring(self) -> LeverSpring:
        """The spring."""
        return LeverSpring(self.b, self.c, self.k, self.r)

    def lift(self, from_rest: FloatArray) -> Lift:
        """Growth of the distance a; with half angles, so that nothing cancels at rest."""
        shortest, area = abs(self.c - self.b), self.b * self.c
        half_sine = np.sin(from_rest / 2)
        doubled = 2 * area * half_sine * half_sine
        growth = 2 * doubled  # a^2 - (c - b)^2
        a = np.sqrt(shortest * shortest + growth)
        sine, cosine = 2 * area * half_sine * np.cos(from_rest / 2), area - doubled
        l1 = sine / a
        l2 = (cosine - l1 * l1) / a
        l3 = -(sine + 3 * l1 * l2) / a
        l4 = -(cosine + 4 * l1 * l3 + 3 * l2 * l2) / a
        return Lift(growth / (a + shortest), l1, l2, l3, l4)
