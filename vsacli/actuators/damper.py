"""A damper whose damping a trajectory commands: between the links, or parallel to the springs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from vsacli.base import units
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import choice, interval, number
from vsacli.documents.record_checks import DeclaredRecord

LOCATIONS = ("link", "transmission")


@dataclass(frozen=True)
class Damper(DeclaredRecord):
    """A damper whose damping a trajectory commands as it does a stiffness."""

    location: str = choice(LOCATIONS, "location: between the links of the joint, or parallel to its springs")
    range: tuple[float, float] = interval(
        units.DAMPING, "range of the damping, not negative; commands outside it are flagged", lowest=0
    )

    start: float | None = number(
        units.POSITION,
        "sum of the deflections of the springs parallel to it at the first sample; by default the "
        "one at which these carry the joint alone",
        default=None,
    )

    @staticmethod
    def example(joint_type: str) -> dict[str, Any]:
        """Return plausible values of the fields, for a new robot file."""
        return {"location": "link", "range": [0, 5] if joint_type == "revolute" else [0, 50]}

    def _problems(self) -> Iterator[FieldProblem]:
        lower, upper = self.range
        if not (lower >= 0 and math.isfinite(upper)):
            reason = f"must be [lower, upper] with 0 <= lower, such as [0, {abs(upper):g}]"
            yield FieldProblem(("range",), reason)
        if self.start is not None and self.location == "link":
            reason = "a damper between the links moves with them; leave it out"
            yield FieldProblem(("start",), reason)
