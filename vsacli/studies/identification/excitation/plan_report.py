"""A planned excitation and what is known of it, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from vsacli.analysis.clearances import MARGIN as CORRIDOR
from vsacli.analysis.joint_report import Worst
from vsacli.analysis.report import Report
from vsacli.base.flags import Flag
from vsacli.base.json_records import Published, named
from vsacli.base.tables import aligned
from vsacli.base.texts import sentence
from vsacli.robot.model import Robot
from vsacli.studies.identification.excitation.allowed import MARGIN
from vsacli.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class ActiveLimit(Published):
    """A bound that keeps an excitation from being larger.

    Attributes:
        joint: name.
        nearest: where it comes next to the bound.
    """

    joint: str
    nearest: Worst

    shape: ClassVar = named("joint", "nearest")

    def __str__(self) -> str:
        worst = self.nearest
        corridor = worst.kind == CORRIDOR
        what = "stiffness" if corridor else Flag.labelled(worst.kind).quantity_of(worst.motor)
        bound = f"{worst.bound:.4g}" + (" that its load allows" if corridor else "")
        return f"{self.joint}: {what} {worst.value:.4g} of {bound} {worst.unit}"


@dataclass(frozen=True)
class Excitation(Published):
    """A motion and a stiffness profile by which the numbers of a robot can be identified.

    Attributes:
        robot: for which it is.
        trajectory: the motion.
        report: of inverse dynamics along it.
        seed: of the search that found it.
        conditions: of the equations of each joint's motors and springs by name of the joint, and of `links`;
            columns divided by their norms.
        own_conditions: the same along the user's own motion; empty if there is none.
        gain: logarithm of the factor by which standard errors are smaller than with the user's own motion, on
            average; NaN if there is none, infinite if that leaves numbers that cannot be told apart.
        active: bounds that keep it from being larger.
        assumptions: what was assumed where the robot has no limits.
    """

    robot: Robot = field(repr=False)
    trajectory: Trajectory
    report: Report = field(repr=False)
    seed: int
    conditions: Mapping[str, float]
    own_conditions: Mapping[str, float]
    gain: float
    active: tuple[ActiveLimit, ...]
    assumptions: tuple[str, ...]

    format: ClassVar[str] = "vsacli-excitation/1"
    shape: ClassVar = {
        "format": "format",
        **named("seed", "conditions"),
        "own_conditions?": "own_conditions",
        "gain": "gain",
        **named("active", "assumptions", "report"),
    }

    @property
    def condition(self) -> float:
        """The largest one."""
        return max(self.conditions.values())

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        steps = f"{self.trajectory.samples} steps, {self.trajectory.duration:g} s"
        yield f"{self.trajectory.name}: {steps}, {self.report.verdict}; seed {self.seed}"
        yield from aligned(self._rows())
        if not math.isnan(self.gain):
            yield f"standard errors are {math.exp(self.gain):.3g} times smaller than with the motion given"
        active = "; ".join(map(str, self.active)) or "no limit"
        yield sentence(f"limits that bind, {100 * MARGIN:g} % from their bounds: {active}")
        yield from (sentence(f"note: {each}") for each in self.assumptions)

    def _rows(self) -> list[tuple[str, ...]]:
        own = self.own_conditions
        header = ("equations of", "condition", *(["of the motion given"] if own else []))
        return [
            header,
            *(
                (name, f"{value:.1f}", *([f"{own[name]:.4g}"] if own else []))
                for name, value in self.conditions.items()
            ),
        ]
