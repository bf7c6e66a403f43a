"""A planned excitation and its usefulness, as text, as JSON and as a trajectory file with comments."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from vsacli.analysis.report import Report
from vsacli.base import file_formats
from vsacli.base.json_records import Published, named
from vsacli.base.signals import COMMANDED, POSITION
from vsacli.base.tables import ReportText, TextReport, headline
from vsacli.base.texts import counted, one_line
from vsacli.base.version import __version__
from vsacli.documents.commented import WIDTH, commented_document
from vsacli.dynamics.limits import MARGIN as CORRIDOR
from vsacli.dynamics.limits import Finding
from vsacli.robot.model import Robot
from vsacli.studies.identification.excitation.family import MARGIN, RATE
from vsacli.studies.identification.excitation.fisher import PredictedError
from vsacli.studies.identification.identification_text import parameters_by_joint
from vsacli.studies.search.fixed_text import formula
from vsacli.trajectory import file as trajectory_file
from vsacli.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class Usefulness(Published):
    """The information of a motion on the parameters of a robot.

    Attributes:
        conditions: condition numbers of the equations of motors and springs, by joint name, and of `links`;
            columns are divided by their norms.
        numbers: predicted standard errors of the parameters.
        reason: reason why none are predicted, as a clause; otherwise empty.
    """

    conditions: Mapping[str, float]
    numbers: tuple[PredictedError, ...] = ()
    reason: str = ""

    shape: ClassVar = {**named("conditions", "numbers"), "reason?": "reason"}


@dataclass(frozen=True)
class Excitation(Published, TextReport):
    """A motion with a stiffness profile that identifies the parameters of a robot.

    Attributes:
        robot: robot to identify.
        trajectory: planned motion.
        report: report of inverse dynamics along the motion.
        seed: seed of the search and of the noise.
        noise: assumed sensor noise in words.
        planned: usefulness of the planned motion.
        own: usefulness of the user's own motion; None without one.
        structural: parameters that no motion of the robot distinguishes, as sentences.
        active: bounds that limit the amplitude.
        assumptions: assumptions in place of missing limits.
    """

    robot: Robot = field(repr=False)
    trajectory: Trajectory
    report: Report = field(repr=False)
    seed: int
    noise: str
    planned: Usefulness
    own: Usefulness | None
    structural: tuple[str, ...]
    active: tuple[Finding, ...]
    assumptions: tuple[str, ...]

    format: ClassVar[str] = "vsacli-excitation/2"
    shape: ClassVar = {
        "format": "format",
        **named("seed", "noise", "planned"),
        "own?": "own",
        "structural": "structural",
        "active": "published_active",
        **named("assumptions", "report"),
    }

    @property
    def published_active(self) -> list[dict[str, Any]]:
        """JSON values of the bounds that limit the amplitude."""
        return [{"joint": each.joint, "nearest": each.as_json()} for each in self.active]

    @property
    def condition(self) -> float:
        """Largest condition number of the planned motion."""
        return max(self.planned.conditions.values())

    @property
    def verdict(self) -> str:
        """Verdict on inverse dynamics along the motion."""
        return self.report.verdict

    @property
    def title(self) -> str:
        """Name of the motion, and the number of parameters whose standard error is predicted."""
        predicted = sum(not math.isnan(each.standard_error) for each in self.planned.numbers)
        known = f"{predicted} of {counted(len(self.planned.numbers), 'parameter')} identifiable"
        if self.planned.reason:
            known = "no standard errors predicted"
        named = f"{self.trajectory.name}: {counted(self.trajectory.samples, 'sample')}"
        return f"{named}, {self.trajectory.duration:g} s; {known}, largest condition {self.condition:.3g}"

    def as_text(self) -> ReportText:
        """Return the report in parts."""
        lines = [
            *self._legend(),
            *(
                f"active limit, {100 * MARGIN:g} % from its bound: {_nearest_bound_text(each)}"
                for each in self.active
            ),
            *([] if self.active else ["active limits: none"]),
            f"seed of the search: {self.seed}",
        ]
        tables = [self._numbers() if self.planned.numbers else [], self._conditions()]
        return ReportText(headline(self.verdict, self.title), list(self._findings()), tables, lines)

    def _findings(self) -> Iterator[str]:
        for whose, useful in (("the plan", self.planned), ("the given motion", self.own)):
            if useful is not None and useful.reason:
                yield f"no standard errors are predicted for {whose}: {useful.reason}"
        yield from (f"unidentifiable by any motion: {each}" for each in self.structural)
        yield from (f"note: {each}" for each in self.assumptions)

    def _legend(self) -> Iterator[str]:
        if any("*" in each.path for each in self.planned.numbers):
            yield "* sum of several parameters"
        if self.planned.numbers:
            yield f"+- standard error for noise of {self.noise}"

    def _conditions(self) -> list[tuple[str, ...]]:
        own = None if self.own is None else self.own.conditions
        header = ("equations of", "condition", *([] if own is None else ["condition of\ngiven motion"]))
        return [
            header,
            *(
                (name, f"{value:.3g}", *([] if own is None else [f"{own[name]:.3g}"]))
                for name, value in self.planned.conditions.items()
            ),
        ]

    def _numbers(self) -> list[tuple[str, ...]]:
        own = None if self.own is None else {each.path: each for each in self.own.numbers}
        given = () if own is None else ("+- of given\nmotion",)
        header = ("parameter", "unit", "file", "+-", "+-\n%", *given)
        rows: list[tuple[str, ...]] = [header]
        for joint, names, numbers in parameters_by_joint(self.planned.numbers, self.robot.joint_names):
            rows += [(joint, *[""] * (len(header) - 1))] if joint else []
            for name, each in zip(names, numbers, strict=True):
                theirs = [] if own is None else [_standard_error_text(own.get(each.path))]
                rows.append(
                    (
                        name,
                        each.unit,
                        f"{each.value:.4g}",
                        _standard_error_text(each),
                        _standard_error_share(each),
                        *theirs,
                    )
                )
        return rows


def _nearest_bound_text(finding: Finding) -> str:
    value, bound = finding.numbers
    reason = " that its load allows" if finding.kind == CORRIDOR else ""
    return f"{finding.joint}: {finding.quantity} {value} of {bound} {finding.unit}{reason}"


def _standard_error_text(number: PredictedError | None) -> str:
    return "-" if number is None or math.isnan(number.standard_error) else f"{number.standard_error:.2g}"


def _standard_error_share(number: PredictedError) -> str:
    """Return the standard error as a percentage of the value, or "-" if the value is zero."""
    if number.value == 0 or math.isnan(number.standard_error):
        return "-"
    share = number.standard_error / abs(number.value)
    return f"{100 * share:.2g}" if share < 1 else "> 100"


def excitation_text(excitation: Excitation) -> str:
    """Return the trajectory file of a planned excitation, as text."""
    trajectory = excitation.trajectory
    profiles = {POSITION.key: trajectory.position}
    profiles |= {
        key: profile
        for key, profile in trajectory.commanded.items()
        if trajectory.chosen(key).any() and COMMANDED[key].device is None
    }
    values: dict[str, Any] = {
        "name": trajectory.name,
        "duration": trajectory.duration,
        "rate": RATE,
    }
    values |= {key: formula(profile) for key, profile in profiles.items()}
    head = [part for line in _head(excitation) for part in textwrap.wrap(one_line(line), WIDTH - 2)]
    return commented_document(file_formats.TRAJECTORY, trajectory_file.OF_ANY_ROBOT, values, head)


def _head(excitation: Excitation) -> Iterator[str]:
    """Yield the comments at the top of the file."""
    names = ", ".join(excitation.robot.joint_names)
    yield (
        f"Excitation to identify {excitation.robot.name} by; planned by vsacli {__version__}, seed "
        f"{excitation.seed}. Lists have an entry for each joint: {names}."
    )
    yield (
        "The plan knows the limits of the robot and nothing of what stands about it: look at the motion, and "
        "try it slowly, before the robot moves."
    )
    yield from excitation.assumptions
