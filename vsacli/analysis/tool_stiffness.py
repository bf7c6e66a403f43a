"""Compliance of the tools along a run, block by block, for its report and its result."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vsacli.actuators.reach import LIMIT_ROUNDING
from vsacli.analysis.tool_report import NO_DIRECTION, ToolReport
from vsacli.base.arrays import AnyArray, BoolArray, FlagArray, FloatArray
from vsacli.base.flags import Flag, SampleFlag, ToolFlag, flags_where, has_flag
from vsacli.base.units import LINEAR_STIFFNESS
from vsacli.base.variables import TIP_COMPLIANCE, Block
from vsacli.base.wrench import Wrench, WrenchFrame
from vsacli.dynamics.limits import Finding, keep_worse
from vsacli.robot.compliance import HeldPose, softest_direction
from vsacli.robot.joint import Tool
from vsacli.robot.model import Robot

COUNTED_AT_TOOLS: dict[str, SampleFlag] = {
    "singular": ToolFlag.STATIC_INSTABILITY,
    "over_limit": ToolFlag.TOOL_STIFFNESS_LIMIT,
}
"""Kinds of trouble whose samples are counted, with their bits."""


class ToolSummary:
    """Summary of one tool; `add` samples in order, then call `report`."""

    def __init__(self, tool: Tool) -> None:
        self._tool = tool
        self._sample_counts = dict.fromkeys(COUNTED_AT_TOOLS, 0)
        self._first_time: dict[str, float] = {}
        self._worst: dict[str, Finding] = {}
        self._rigid = False
        self._softest = (math.nan, math.nan, NO_DIRECTION)

    def add(
        self, time: FloatArray, stiffness: FloatArray, direction: FloatArray, unstable: BoolArray
    ) -> FlagArray:
        """Merge samples, and return their flags, (samples,).

        Args:
            time: Times, (samples,).
            stiffness: Stiffness in the softest direction, (samples,), NaN where there is none, inf if rigid.
            direction: This direction, (samples, 3).
            unstable: Where the pose is statically unstable, (samples,).
        """
        required = self._tool.min_stiffness or 0.0
        is_below = stiffness < (1 - LIMIT_ROUNDING) * required
        self._rigid |= bool(np.isinf(stiffness).any())
        if np.isfinite(stiffness).any():
            self._keep_softest(time, stiffness, direction)
        if is_below.any():
            sample = int(np.where(is_below, stiffness, np.inf).argmin())
            self._keep_worse(ToolFlag.TOOL_STIFFNESS_LIMIT, time[sample], float(stiffness[sample]), required)
        if unstable.any():
            self._keep_worse(ToolFlag.STATIC_INSTABILITY, time[unstable.argmax()], math.nan, math.nan)
        flags: FlagArray = flags_where(ToolFlag.STATIC_INSTABILITY, unstable)
        flags |= flags_where(ToolFlag.TOOL_STIFFNESS_LIMIT, is_below)
        for kind, bit in COUNTED_AT_TOOLS.items():
            is_flagged = has_flag(flags, bit)
            self._sample_counts[kind] += int(is_flagged.sum())
            if is_flagged.any():
                for name in (kind, bit.label):
                    self._first_time.setdefault(name, float(time[is_flagged.argmax()]))
        return flags

    def report(self) -> ToolReport:
        """Return the report so far."""
        return ToolReport(
            self._tool.name,
            dict(self._sample_counts),
            dict(self._first_time),
            dict(self._worst),
            *self._softest,
            self._tool.min_stiffness,
            rigid=self._rigid and math.isnan(self._softest[0]),
        )

    def _keep_softest(self, time: FloatArray, stiffness: FloatArray, direction: FloatArray) -> None:
        sample = int(np.nanargmin(stiffness))
        if not self._softest[0] <= stiffness[sample]:
            x, y, z = direction[sample].tolist()
            self._softest = float(stiffness[sample]), float(time[sample]), (x, y, z)

    def _keep_worse(self, flag: ToolFlag, time: float, value: float, bound: float) -> None:
        unit = LINEAR_STIFFNESS.unit("")
        finding = Finding(flag.label, float(time), value, bound, unit, tool=self._tool.name)
        keep_worse(self._worst, finding)


class ToolStiffness:
    """Compliance of the tools along a run, and their reports; `add` blocks in order, then call `reports`.

    Args:
        robot: Robot.
        frame: Frame of the wrench on the tools; None without one.
        stored: Whether blocks get the compliance itself, not only flags.
    """

    def __init__(self, robot: Robot, frame: WrenchFrame | None, *, stored: bool) -> None:
        self._robot, self._frame, self._stores_compliance = robot, frame, stored
        self._summaries = [ToolSummary(tool) for tool in robot.end_effectors]

    def add(self, block: Block) -> dict[str, AnyArray]:
        """Merge a block into the reports, and return the variables of tools by name."""
        wrench = None if self._frame is None else Wrench.constant(block.wrench, self._frame)
        pose = HeldPose(self._robot, block.q, block.stiffness, wrench)
        flags: list[FlagArray] = []
        compliances: list[FloatArray] = []
        for tool, (carrier, summary) in enumerate(zip(self._robot.tool_joints, self._summaries, strict=True)):
            compliance, unstable = pose.compliance(tool)
            moving_joints = list(self._robot.paths[carrier])
            infeasible = has_flag(block.flags[:, moving_joints], Flag.INFEASIBLE).any(axis=1)
            compliance[infeasible] = np.nan
            flags.append(summary.add(block.time, *softest_direction(compliance), unstable & ~infeasible))
            compliances.append(compliance)
        requested = {TIP_COMPLIANCE: np.stack(compliances, axis=1)} if self._stores_compliance else {}
        return {"tool_flags": np.stack(flags, axis=1), **requested}

    def reports(self) -> tuple[ToolReport, ...]:
        """Return the report of each tool so far."""
        return tuple(summary.report() for summary in self._summaries)


def limits_for_fixes(robot: Robot, reports: Sequence[ToolReport]) -> list[str]:
    """Return changes with which fixes of unstable poses are searched: these need a limit, a tiny one.

    There are none if a tool has a limit, or if all poses are stable.
    """
    unstable = [report.name for report in reports if report.shows("singular")]
    if not unstable or robot.limited_tools:
        return []
    if robot.tools:
        return [f"tools.{unstable[0]}.min_stiffness=1"]
    return [f"tools={{{unstable[0]}: {{joint: {robot.joint_names[-1]}, min_stiffness: 1}}}}"]
