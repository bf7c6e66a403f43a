"""The report of a run: one object, rendered as text and as JSON, and stored in the result file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

from vsacli.analysis import report_text as text
from vsacli.analysis.dry_friction import dry_friction_lines
from vsacli.analysis.joint_report import JointDrift, JointReport
from vsacli.analysis.report_text import energy_lines
from vsacli.analysis.self_check import DRIFT_BOUND, SPRING_BOUND, SelfCheck
from vsacli.analysis.tool_report import ToolReport, tool_stiffness_lines
from vsacli.analysis.trouble_text import (
    NOT_DETERMINED,
    failing_joints_line,
    finding_lines,
    little_effect,
    spread_lines,
    uncertainty_lines,
)
from vsacli.base.json_records import JsonObject, Stored, named
from vsacli.base.signals import STIFFNESS
from vsacli.base.tables import ReportText, TextReport, headline
from vsacli.base.texts import counted, warnings_and_notes

_ROW_WARNING = re.compile(r":\d+: |^\w+\[\d+")
"""Regular expression of a warning on a row of a file or a sample of an array."""

VERDICTS = ("ok", "over_limit", "singular", "infeasible", "unreliable", "self_check_failed")
"""Verdicts from best to worst; the worst that applies wins."""


@dataclass(frozen=True)
class Report(Stored, TextReport):
    """Report of a run, with the verdict.

    Attributes:
        robot: Name of the robot.
        trajectory: Name of the trajectory.
        samples: Number of samples computed, both ends included.
        duration: Time from the first to the last sample of the trajectory, s.
        complete: Whether every sample of the trajectory was computed.
        warnings: Doubts about the inputs.
        notes: Interpretation of the inputs, where it is not obvious.
        self_check: Outcome of the self-check.
        joints: Reports of the joints.
        drifts: Drifts of the joints if the deflections were integrated, else empty.
        fits: Facts about the splines that replace recorded samples, JSON values.
        tools: Reports of the tools if their stiffness is limited or was asked for, else empty.
    """

    robot: str
    trajectory: str
    samples: int
    duration: float
    complete: bool
    self_check: SelfCheck
    joints: tuple[JointReport, ...]
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    drifts: tuple[JointDrift, ...] = ()
    fits: tuple[dict[str, Any], ...] = ()
    tools: tuple[ToolReport, ...] = ()

    format: ClassVar = "vsacli-report/2"
    shape: ClassVar = {
        **named("format", "verdict", "robot", "trajectory", "samples", "duration", "complete"),
        **named("warnings", "notes", "fits", "self_check"),
        "deflections": {"method": "deflections", "joints?": "drifts"},
        "joints": "joints",
        "tools?": "tools",
    }

    @property
    def verdict(self) -> str:
        """Verdict: the worst of `VERDICTS` that applies."""
        if not self.self_check.passed:
            return VERDICTS[-1]
        joints_and_tools: tuple[JointReport | ToolReport, ...] = (*self.joints, *self.tools)
        applicable = (
            verdict
            for verdict in reversed(VERDICTS)
            if any(member.shows(verdict) for member in joints_and_tools)
        )
        return next(applicable, "ok")

    @property
    def deflections(self) -> str:
        """Method for the deflections: "root" of (14) at each sample, or "ode"."""
        return "ode" if self.drifts else "root"

    def as_text(self, hint: str = "") -> ReportText:
        """Return the report in its parts, as people read it.

        Args:
            hint: a line below the findings, such as the command that lists fixes; none if empty.
        """
        causes = [warning for warning in self.warnings if self._is_cause(warning)]
        other_warnings = [warning for warning in self.warnings if not self._is_cause(warning)]
        entries = [
            *self._failed_check(),
            *warnings_and_notes(causes, ()),
            *finding_lines((*self.joints, *self.tools), self.samples),
            *text.integration_stop_lines(self.joints, self.drifts),
            *self._recorded_infeasible(causes=bool(causes)),
            *([hint] if hint else []),
            *uncertainty_lines(self.joints),
            *warnings_and_notes(other_warnings, ()),
            *(little_effect(self.joints) if any(NOT_DETERMINED in each for each in other_warnings) else []),
            *warnings_and_notes((), self.notes),
        ]
        lines = [
            *text.initial_motor_lines(self.joints),
            *text.final_motor_lines(self.joints),
            *dry_friction_lines(
                [(joint.name, joint.type, motor) for joint in self.joints for motor in joint.dry_friction]
            ),
            *energy_lines([(joint.name, joint.type, joint.energy) for joint in self.joints]),
            *tool_stiffness_lines(
                self.tools, infeasible=any(joint.samples["infeasible"] for joint in self.joints)
            ),
            *spread_lines(self.joints),
            *text.drift_lines(self.drifts),
            *([text.self_check_line(self.self_check)] if self.self_check.passed else []),
        ]
        return ReportText(
            headline(self.verdict, self._title()), entries, [text.joint_rows(self.joints)], lines
        )

    def _is_cause(self, warning: str) -> bool:
        """Return whether the findings may follow from what a warning is about.

        This is so for a question, which asks whether an input is meant, as in another unit, and for faults at
        a row of a recording.
        """
        return "?" in warning or (bool(self.fits) and _ROW_WARNING.search(warning) is not None)

    def _recorded_infeasible(self, *, causes: bool) -> Iterator[str]:
        """Yield what infeasible samples mean if the stiffness was recorded, too, without any other cause."""
        has_recorded_stiffness = any(fit.get("signal") == STIFFNESS.key for fit in self.fits)
        if (
            has_recorded_stiffness
            and not causes
            and any(joint.samples["infeasible"] for joint in self.joints)
        ):
            yield (
                "if the arm did move like this, the recorded stiffness or the springs of the robot file are "
                "wrong: run vsacli identify first"
            )

    def _failed_check(self) -> list[str]:
        return [] if self.self_check.passed else [text.self_check_line(self.self_check)]

    def _title(self) -> str:
        """Return names, size, and how many joints fail which requirement."""
        length_text = counted(self.samples, "sample") + ("" if self.complete else ", stopped early")
        title = f"{self.robot}, {self.trajectory}: {length_text}, {self.duration:g} s"
        return "; ".join([title, *filter(None, [failing_joints_line(self.joints, self.tools)])])

    @classmethod
    def from_json(cls, content: JsonObject, **further: Any) -> Self:
        """Return the report from the output of `as_json`, which result files hold.

        Raises:
            LookupError, TypeError, AttributeError, ValueError: The content is no such report.
        """
        report = super().from_json(content, **further)
        # The bound is not stored: it follows from the method for the deflections.
        bound = DRIFT_BOUND if report.drifts else SPRING_BOUND
        return replace(report, self_check=replace(report.self_check, spring_bound=bound))
