"""A planned excitation and its usefulness, as text, as JSON and as a trajectory file with comments."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from vsacli.analysis.joint_report import Worst
from vsacli.analysis.minima import MARGIN as CORRIDOR
from vsacli.analysis.report import Report
from vsacli.base.flags import Flag
from vsacli.base.json_records import Published, named
from vsacli.base.signals import COMMANDED, POSITION
from vsacli.base.tables import aligned
from vsacli.base.texts import one_line, sentence
from vsacli.base.version import __version__
from vsacli.documents.commented import WIDTH, commented_document
from vsacli.robot.model import Robot
from vsacli.studies.identification.excitation.family import MARGIN, RATE
from vsacli.studies.identification.excitation.fisher import PredictedError
from vsacli.studies.search.fixed_text import formula
from vsacli.trajectory import file as trajectory_file
from vsacli.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class ActiveLimit(Published):
    """A bound that limits the amplitude of an excitation.

    Attributes:
        joint: name of the joint.
        nearest: sample closest to the bound.
    """

    joint: str
    nearest: Worst

    shape: ClassVar = named("joint", "nearest")

    def __str__(self) -> str:
        worst = self.nearest
        corridor = worst.kind == CORRIDOR
        what = "stiffness" if corridor else Flag.labeled(worst.kind).quantity_of(worst.motor)
        reason = " that its load allows" if corridor else ""
        return f"{self.joint}: {what} {worst.value:.4g} of {worst.bound:.4g} {worst.unit}{reason}"


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
class Excitation(Published):
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
    active: tuple[ActiveLimit, ...]
    assumptions: tuple[str, ...]

    format: ClassVar[str] = "vsacli-excitation/2"
    shape: ClassVar = {
        "format": "format",
        **named("seed", "noise", "planned"),
        "own?": "own",
        **named("structural", "active", "assumptions", "report"),
    }

    @property
    def condition(self) -> float:
        """Largest condition number of the planned motion."""
        return max(self.planned.conditions.values())

    def __str__(self) -> str:
        return "\n".join(line.rstrip() for line in self._lines())

    def _lines(self) -> Iterator[str]:
        steps = f"{self.trajectory.samples} steps, {self.trajectory.duration:g} s"
        yield f"{self.trajectory.name}: {steps}, seed {self.seed}: {self.report.verdict.upper()}"
        yield from aligned(self._conditions())
        yield from aligned(self._numbers())
        if any("*" in each.path for each in self.planned.numbers):
            yield "* begins the name of a combination with parameters of other links."
        yield sentence(f"+- are standard errors with noise of {self.noise}")
        for whose, useful in (("the excitation", self.planned), ("the motion given", self.own)):
            if useful is not None and useful.reason:
                yield sentence(f"of {whose} none are predicted: {useful.reason}")
        active = "; ".join(map(str, self.active)) or "none"
        yield sentence(f"limits that bind, {100 * MARGIN:g} % from their bounds: {active}")
        yield from (sentence(f"no motion of this robot tells: {each}") for each in self.structural)
        yield from (sentence(f"note: {each}") for each in self.assumptions)

    def _conditions(self) -> list[tuple[str, ...]]:
        own = None if self.own is None else self.own.conditions
        header = ("equations of", "condition", *([] if own is None else ["motion given"]))
        return [
            header,
            *(
                (name, f"{value:.3g}", *([] if own is None else [f"{own[name]:.3g}"]))
                for name, value in self.planned.conditions.items()
            ),
        ]

    def _numbers(self) -> list[tuple[str, ...]]:
        own = None if self.own is None else {each.path: each for each in self.own.numbers}
        rows = [("number", "file", "+-", "share", *([] if own is None else ["+- motion given"]), "unit")]
        for each in self.planned.numbers:
            given = [] if own is None else [_error(own.get(each.path))]
            rows.append((each.path, f"{each.value:.6g}", _error(each), _share(each), *given, each.unit))
        return rows


def _error(number: PredictedError | None) -> str:
    return "-" if number is None or math.isnan(number.standard_error) else f"{number.standard_error:.2g}"


def _share(number: PredictedError) -> str:
    """Return the standard error as a percentage of the value, or "-" if the value is zero."""
    if number.value == 0 or math.isnan(number.standard_error):
        return "-"
    share = number.standard_error / abs(number.value)
    return f"{100 * share:.2g} %" if share < 1 else "> 100 %"


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
    return commented_document(trajectory_file.FORMAT, trajectory_file.OF_ANY_ROBOT, values, head)


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
