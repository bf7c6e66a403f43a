"""The actuator with adjustable stiffness (AwAS): springs at the end of an arm whose length motor 2 sets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from vsacli.actuators.mechanisms.ratios.ratio import SineRatio
from vsacli.actuators.mechanisms.ratios.scales import Scale
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import NON_ZERO, POSITIVE, check_fields, interval, number


@dataclass(frozen=True)
class Awas(SineRatio):
    """Two springs that pull an arm of length r = lead theta_2 from either side: U = k r^2 sin^2(phi).

    Jafari, Tsagarakis, Vanderborght & Caldwell, IROS 2010.
    """

    k: float = number(units.LINEAR_STIFFNESS, "stiffness of either spring", check=POSITIVE)
    arm: tuple[float, float] = interval(units.LENGTH, "shortest and longest arm, above zero")
    lead: float = number(units.LEAD, "length that the arm gains per theta_2", check=NON_ZERO)

    def __post_init__(self) -> None:
        problems = []
        if not 0 < self.arm[0] < self.arm[1] < np.inf:
            problems.append(FieldProblem(("arm",), "must have two ends above zero, the shorter one first"))
        check_fields(self, *problems)

    @classmethod
    def example(cls, joint_type: str) -> dict[str, Any]:  # noqa: ARG003
        """Arms from 5 to 12 cm."""
        return {"k": 50000, "arm": [0.05, 0.12], "lead": 0.01}

    @property
    def setting_range(self) -> tuple[float, float]:
        """theta_2 at the ends of the arm."""
        low, high = sorted(arm / self.lead for arm in self.arm)
        return low, high

    @property
    def scale_range(self) -> tuple[float, float]:
        """K at the ends of the arm."""
        shortest, longest = self.arm
        return self.k * shortest * shortest, self.k * longest * longest

    def scale(self, s: FloatArray) -> Scale:
        """K = k r^2."""
        curvature = self.k * self.lead * self.lead
        return Scale(curvature * s * s, 2 * curvature * s, np.full_like(s, 2 * curvature))

    def setting(self, scale: FloatArray) -> FloatArray:
        """The arm is sqrt(K/k)."""
        return np.sqrt(scale / self.k) / self.lead
