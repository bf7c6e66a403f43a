"""What inverse dynamics along a whole trajectory returns."""

from __future__ import annotations

from dataclasses import dataclass, field

from vsacli.analysis.report import Report
from vsacli.base.variables import Block


@dataclass(frozen=True, eq=False)
class Result(Block):
    """Every variable over the whole trajectory, and the report on it."""

    report: Report = field(kw_only=True)
    joint_names: tuple[str, ...] = field(kw_only=True)
