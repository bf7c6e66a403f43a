"""Findings of a run at one tool: how stiff it is with the motors held, in which direction, and when."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

from vsacli.analysis.report_text import short_number, wrap_joint_entries
from vsacli.base.json_records import Stored, named
from vsacli.base.texts import joined
from vsacli.base.units import LINEAR_STIFFNESS, time_text
from vsacli.dynamics.limits import Finding

NO_DIRECTION = (math.nan, math.nan, math.nan)
OPTIONAL_FIELDS = {"rigid?": "rigid", "required?": "required"}


@dataclass(frozen=True)
class ToolReport(Stored):
    """Findings of a run at one tool.

    Attributes:
        name: Name of the tool.
        samples: Number of samples with each kind of trouble.
        first_time: Time of the first sample of each kind that occurs, s.
        worst: Worst sample of each kind that occurs, by its flag.
        stiffness: Smallest translational stiffness along the motion, N/m; NaN if it has none, or is rigid.
        time: Time of the smallest stiffness, s.
        direction: Unit vector of the softest direction at that time, base axes.
        required: Smallest stiffness that the tool may have, N/m; None without this limit.
        rigid: Whether the tool does not yield at any sample.
    """

    name: str
    samples: dict[str, int]
    first_time: dict[str, float]
    worst: dict[str, Finding]
    stiffness: float = math.nan
    time: float = math.nan
    direction: tuple[float, float, float] = NO_DIRECTION
    required: float | None = None
    rigid: bool = False

    shape: ClassVar = {
        **named("name", "samples", "first_time", "worst"),
        "stiffness": {"min": "stiffness", **named("time", "direction"), **OPTIONAL_FIELDS},
    }

    def shows(self, verdict: str) -> bool:
        """Return whether the tool is a reason for a verdict that is not ok."""
        return bool(self.samples.get(verdict))


def unjudged_tools_text(limited_tools: Sequence[str]) -> str:
    """Return that an analysis does not judge the min_stiffness of the tools that have one."""
    return f"min_stiffness of {joined(limited_tools)} is not judged here; check-feasibility does so"


def tool_stiffness_lines(tools: Sequence[ToolReport], *, infeasible: bool = False) -> Iterator[str]:
    """Yield how stiff each tool is at least, where, and in which direction."""
    unit = LINEAR_STIFFNESS.unit("")
    entries = [
        f"{tool.name} does not yield"
        if tool.rigid
        else f"{tool.name} {short_number(tool.stiffness)} {unit} at {time_text(tool.time)} "
        f"along ({', '.join(f'{round(component, 2) + 0.0:.2f}' for component in tool.direction)})"
        for tool in tools
        if tool.rigid or math.isfinite(tool.stiffness)
    ]
    if entries:
        yield wrap_joint_entries(
            f"smallest stiffness of tools{' over feasible samples' if infeasible else ''}: ", entries
        )
