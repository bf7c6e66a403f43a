"""The report on a simulation: verdict, errors and effort, as an object, text and JSON, stored in the file."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

from vsacli.analysis.report_text import energy_lines
from vsacli.analysis.tool_report import ToolReport, tool_stiffness_lines
from vsacli.analysis.trouble_text import failing_joints_line, group_findings, of_all_joints
from vsacli.base.flags import LIMITS, Flag
from vsacli.base.json_records import Published, Stored, named
from vsacli.base.tables import ReportText, TextReport, headline
from vsacli.base.texts import counted, warnings_and_notes
from vsacli.base.units import time_text
from vsacli.control.simulation.ending import DIVERGED, INCOMPLETE, Ending
from vsacli.control.simulation.integrator import Method
from vsacli.control.simulation.joint_tracking import (
    Deviation,
    JointTracking,
    error_text,
    tracking_findings,
    tracking_rows,
)
from vsacli.dynamics.limits import Finding

VERDICTS = ("ok", "over_limit", "off_target", "singular", "infeasible", INCOMPLETE, DIVERGED)
"""Verdicts from best to worst; the worst that applies wins."""

_VERDICT_FLAGS = {"over_limit": LIMITS, "singular": Flag.SINGULAR, "infeasible": Flag.INFEASIBLE | Flag.SLACK}


def verdict_on(
    flags: int, joints: Sequence[JointTracking], tools: Sequence[ToolReport], ending: Ending | None
) -> str:
    """Return the worst of `VERDICTS` that applies, by the flags of any joint or tool at any sample.

    A flag at any sample implies its own verdict. A complete run with joints off target is "off_target". An
    early end without a flag has its own verdict.
    """
    verdicts = {verdict for verdict, bits in _VERDICT_FLAGS.items() if flags & bits}
    verdicts |= {verdict for verdict in VERDICTS if any(tool.shows(verdict) for tool in tools)}
    if ending is None and any(joint.off_course for joint in joints):
        verdicts.add("off_target")
    if ending is not None and ending.flag is None:
        verdicts.add(ending.verdict)
    return next((verdict for verdict in reversed(VERDICTS) if verdict in verdicts), "ok")


@dataclass(frozen=True)
class LargestError(Published):
    """The largest error of q relative to the tolerance of its joint at the end.

    Attributes:
        joint: name of the joint.
        value: magnitude of the error, rad (m).
        unit: unit of the error.
        time: time of the error, s.
    """

    joint: str
    value: float
    unit: str
    time: float


@dataclass(frozen=True)
class SimulationReport(Stored, TextReport):
    """The report on a simulation.

    Attributes:
        robot: name of the robot.
        trajectory: name of the trajectory.
        controller: controller, as named on the command line.
        samples: number of samples stored.
        duration: time from the first to the last sample of the trajectory, s.
        verdict: worst of `VERDICTS` that applies; see `verdict_on`.
        ending: sentence on an early end; None for a complete run.
        evaluations: evaluations of the equations of motion.
        budget: largest number of evaluations; 0 in reports of versions without it.
        methods: methods of integration, each from its time on; empty in such reports.
        warnings: warnings about inputs and results.
        notes: notes on the interpretation of the inputs, where that is not obvious.
        joints: findings of each joint.
        with_full_state: deviation of q of each joint in the same run when the controller knows the full state
            at every instant; empty unless only positions are measured.
        tools: reports of the tools if the stiffness of one is limited, else empty.
    """

    robot: str
    trajectory: str
    controller: str
    samples: int
    duration: float
    verdict: str
    ending: str | None
    evaluations: int
    joints: tuple[JointTracking, ...]
    warnings: tuple[str, ...]
    with_full_state: tuple[Deviation, ...]
    notes: tuple[str, ...] = ()
    budget: int = 0
    methods: tuple[Method, ...] = ()
    tools: tuple[ToolReport, ...] = ()

    format: ClassVar = "vsacli-simulation-report/2"
    shape: ClassVar = {
        **named("format", "verdict", "robot", "trajectory", "controller", "samples", "duration", "complete"),
        "largest_error?": "largest_error",
        **named(
            "ending", "evaluations", "budget", "methods", "warnings", "notes", "joints", "with_full_state"
        ),
        "tools?": "tools",
    }

    @property
    def complete(self) -> bool:
        """Whether the run reached the end of the trajectory."""
        return self.ending is None

    @property
    def largest_error(self) -> LargestError | None:
        """Largest error of q during the run; None without a goal tolerance."""
        if any(math.isnan(joint.tolerance) for joint in self.joints):
            return None
        worst = max(self.joints, key=lambda joint: joint.q.peak / max(joint.tolerance, sys.float_info.min))
        return LargestError(worst.name, worst.q.peak, worst.unit, worst.q.time)

    def as_text(self) -> ReportText:
        """Return the report in its parts, as people read it."""
        findings = [
            *([] if self.ending is None else [self.ending]),
            *group_findings(
                [*tracking_findings(self.joints, self.complete), *self._tool_findings()],
                [*(joint.name for joint in self.joints), *(tool.name for tool in self.tools)],
            ),
            *warnings_and_notes(self.warnings, self.notes),
        ]
        lines = [
            *energy_lines([(joint.name, joint.type, joint.energy) for joint in self.joints]),
            *tool_stiffness_lines(self.tools),
            *self._effort_line(),
        ]
        return ReportText(
            headline(self.verdict, self._headline_text()),
            findings,
            [tracking_rows(self.joints, self.with_full_state)],
            lines,
        )

    def _headline_text(self) -> str:
        """Return names, controller, the largest error, and how many joints fail which requirement."""
        parts = [f"{self.robot}, {self.trajectory}: {self.controller}, {self.duration:g} s"]
        if self.samples > 1 and (error := self.largest_error) is not None:
            has_larger = any(joint.q.peak > error.value for joint in self.joints if joint.unit == error.unit)
            relative = " relative to its tolerance" if has_larger else ""
            place_and_time = f"{error.joint}, t = {time_text(error.time)}"
            parts.append(
                f"largest q error{relative} {error_text(error.value)} {error.unit} ({place_and_time})"
            )
        failing_joints = {
            "off target": sum(self.complete and joint.off_course for joint in self.joints),
            "over a limit": sum(bool(joint.worst) for joint in self.joints),
        }
        failures = [of_all_joints(failing_joints, len(self.joints)), failing_joints_line((), self.tools)]
        return "; ".join([*parts, *filter(None, [", ".join(filter(None, failures))])])

    def _tool_findings(self) -> Iterator[tuple[int, Finding]]:
        for index, tool in enumerate(self.tools, len(self.joints)):
            yield from ((index, worst) for worst in tool.worst.values())

    def _effort_line(self) -> Iterator[str]:
        if self.methods:
            first, *later_methods = self.methods
            changes = "".join(
                f", from t = {time_text(method.start)} on {method.name}" for method in later_methods
            )
            effort = f"{self.evaluations} of at most {counted(self.budget, 'evaluation')}"
            yield f"integration: {first.name}{changes}; {effort}"
