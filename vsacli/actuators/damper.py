"""A damper whose damping a trajectory commands: between the links, or parallel to the springs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from vsacli.base import units
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import check_fields, choice, interval

LOCATIONS = ("link",)


@dataclass(frozen=True)
class Damper:
    """A damper whose damping a trajectory commands as it does a stiffness."""

    location: str = choice(LOCATIONS, "between the links of the joint", not_yet=("transmission",))
    range: tuple[float, float] = interval(
        units.DAMPING, "damping that it can have, from zero or above; flagged beyond"
    )

    @staticmethod
    def example(joint_type: str) -> dict[str, Any]:
        """Plausible values of its fields, as a new robot file shows them."""
        return {"location": "link", "range": [0, 5] if joint_type == "revolute" else [0, 50]}

    def __post_init__(self) -> None:
        problems = []
        lower, upper = self.range
        if not (lower >= 0 and math.isfinite(upper)):
            reason = f"must be [lower, upper] with 0 <= lower, such as [0, {abs(upper):g}]"
            problems.append(FieldProblem(("range",), reason))
        check_fields(self, *problems)
