"""The verdict on a run: one object, rendered as text and as JSON, and stored in the result file."""

from __future__ import annotations

from typing import Any, NamedTuple

from vsacli.analysis import report_text as text
from vsacli.analysis.joint_report import JointDrift, JointReport
from vsacli.analysis.self_check import DRIFT_BOUND, LADDER_BOUND, SPRING_BOUND, SelfCheck
from vsacli.base.json_values import JsonObject, finite, number

FORMAT = "vsacli-report/1"

VERDICTS = ("ok", "over_limit", "singular", "infeasible", "self_check_failed")
"""From best to worst; the worst that applies wins."""


class Report(NamedTuple):
    """The verdict on a run.

    Attributes:
        robot: name of the robot.
        trajectory: name of the trajectory.
        samples: steps computed, both ends included.
        duration: time from the first to the last step of the trajectory, s.
        complete: whether every step of the trajectory was computed.
        warnings: why the inputs may not be what was meant.
        notes: how they were understood, where that is not obvious.
        self_check: outcome of the self-check.
        joints: one report a joint.
        drifts: one a joint if the deflections were followed by integration, else none.
        fits: what is known of the splines that recorded samples were replaced by, JSON values.
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

    @property
    def verdict(self) -> str:
        """The worst of `VERDICTS` that applies."""
        applies = {kind for joint in self.joints for kind, count in joint.steps.items() if count}
        if not self.self_check.passed:
            applies.add("self_check_failed")
        return next((verdict for verdict in reversed(VERDICTS) if verdict in applies), "ok")

    def __str__(self) -> str:
        """The lines that the commands print, without a final newline."""
        return "\n".join(
            [
                self._headline(),
                *text.joint_table(self.joints),
                *text.warnings_and_notes(self.warnings, self.notes),
                *(sentence for joint in self.joints for sentence in text.sentences(joint)),
                *text.stops(self.joints, self.drifts),
                *text.start(self.joints),
                *text.energy_lines([(joint.name, joint.type, joint.energy) for joint in self.joints]),
                *text.drift_lines(self.drifts),
                text.self_check_line(self.self_check),
            ]
        )

    def _headline(self) -> str:
        left = f"{self.robot}, {self.trajectory}: {text.count(self.samples)}, {self.duration:g} s"
        if not self.complete:
            left += " planned, stopped early"
        return text.headline(left, self.verdict, self.joints)

    def as_json(self) -> dict[str, Any]:
        """JSON values for `json.dumps`; numbers that are not finite become None."""
        check = self.self_check
        content: dict[str, Any] = finite(
            {
                "format": FORMAT,
                "verdict": self.verdict,
                "robot": self.robot,
                "trajectory": self.trajectory,
                "samples": self.samples,
                "duration": self.duration,
                "complete": self.complete,
                "warnings": list(self.warnings),
                "notes": list(self.notes),
                "fits": list(self.fits),
                "self_check": {
                    "passed": check.passed,
                    "spring_residual": check.spring_residual,
                    "ladder": check.ladder,
                    "bound": LADDER_BOUND,
                },
                "deflections": self._deflections(),
                "joints": [joint.as_json() for joint in self.joints],
            }
        )
        return content

    def _deflections(self) -> dict[str, Any]:
        if not self.drifts:
            return {"method": "root"}
        return {"method": "integrate", "joints": [drift.as_json() for drift in self.drifts]}

    @classmethod
    def from_json(cls, content: JsonObject) -> Report:
        """From what `as_json` gave, as a result file holds it.

        Raises:
            LookupError, TypeError, AttributeError, ValueError: it is no such report.
        """
        check, drifts = content["self_check"], content["deflections"].get("joints", ())
        return cls(
            **{name: content[name] for name in ("robot", "trajectory", "samples", "duration", "complete")},
            warnings=tuple(content["warnings"]),
            notes=tuple(content.get("notes", ())),
            fits=tuple(content["fits"]),
            self_check=SelfCheck(
                number(check["spring_residual"]),
                number(check["ladder"]),
                DRIFT_BOUND if drifts else SPRING_BOUND,
            ),
            joints=tuple(map(JointReport.from_json, content["joints"])),
            drifts=tuple(map(JointDrift.from_json, drifts)),
        )
