"""What inverse dynamics along a whole trajectory returns."""

from __future__ import annotations

from vsacli.analysis.report import Report
from vsacli.base.arrays import AnyArray
from vsacli.base.variables import Block


class Result(Block):
    """Every variable over the whole trajectory, and the report on it.

    Attributes:
        report: the verdict.
        joint_names: names of the joints, base to tip.
    """

    def __init__(self, *, report: Report, joint_names: tuple[str, ...], **arrays: AnyArray) -> None:
        super().__init__(**arrays)
        self.report = report
        self.joint_names = joint_names
