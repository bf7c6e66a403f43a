"""A lever with a moving pivot between the spring and the link: AwAS-II, CompAct-VSA, vsaUT-II."""

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
class Lever(SineRatio):
    """A spring at one end of a lever, the link at the other, the pivot between them at p = lead theta_2.

    The lever of length L multiplies what the spring gives by p/(L - p): U = k/2 L^2 (p/(L - p))^2 sin^2(phi).
    Jafari, Tsagarakis & Caldwell, ICRA 2011 (AwAS-II); Groothuis, Rusticelli, Zucchelli, Stramigioli &
    Carloni, IEEE/ASME Transactions on Mechatronics 2014 (vsaUT-II).
    """

    k: float = number(units.LINEAR_STIFFNESS, "stiffness of the spring", check=POSITIVE)
    length: float = number(units.LENGTH, "length L of the lever, from the spring to the link", check=POSITIVE)
    pivot: tuple[float, float] = interval(
        units.LENGTH, "range of the pivot's distance p from the spring, above zero and below the length"
    )
    lead: float = number(units.LEAD, "way of the pivot per theta_2", check=NON_ZERO)

    def __post_init__(self) -> None:
        problems = []
        if not 0 < self.pivot[0] < self.pivot[1] < self.length:
            reason = (
                f"must have two ends between zero and the length {self.length:g} m, the smaller one first"
            )
            problems.append(FieldProblem(("pivot",), reason))
        check_fields(self, *problems)

    @classmethod
    def example(cls, joint_type: str) -> dict[str, Any]:  # noqa: ARG003
        """A pivot that moves over half of a lever of 10 cm."""
        return {"k": 20000, "length": 0.1, "pivot": [0.03, 0.08], "lead": 0.01}

    @property
    def setting_range(self) -> tuple[float, float]:
        """theta_2 at the ends of the pivot's way."""
        low, high = sorted(pivot / self.lead for pivot in self.pivot)
        return low, high

    @property
    def scale_range(self) -> tuple[float, float]:
        """K at the ends of the pivot's way."""
        low, high = (float(self.scale(np.array(pivot / self.lead)).value) for pivot in self.pivot)
        return low, high

    def scale(self, s: FloatArray) -> Scale:
        """K = k/2 (L x)^2 with x = p/(L - p)."""
        rest = self.length - self.lead * s
        ratio, slope = self.lead * s / rest, self.length * self.lead / (rest * rest)
        factor = self.k * self.length * self.length
        # x'' is 2 x' lead/(L - p)
        bent = slope * slope + 2 * self.lead * ratio * slope / rest
        return Scale(factor / 2 * ratio * ratio, factor * ratio * slope, factor * bent)

    def setting(self, scale: FloatArray) -> FloatArray:
        """The pivot is at L x/(1 + x)."""
        ratio = np.sqrt(2 * scale / self.k) / self.length
        return self.length * ratio / (1 + ratio) / self.lead
