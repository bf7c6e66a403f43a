"""Levels that are held, with rest-to-rest changes between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from vsacli.base import units
from vsacli.base.errors import FieldProblem
from vsacli.base.signals import STIFFNESS, WRENCH
from vsacli.documents.fields import (
    NON_NEGATIVE,
    POSITIVE,
    Items,
    Number,
    PerJoint,
    Vector,
    check_fields,
    integer,
    number,
    value,
)
from vsacli.trajectory.curves.piecewise import Chain, stepwise
from vsacli.trajectory.declared import degrees
from vsacli.trajectory.declared.course import SAME_TIME, Course, Values, numbers
from vsacli.trajectory.declared.framed import Framed


def _degree() -> Any:
    return integer("degree of the polynomials that lead from level to level", check=degrees.STEPPED)


def _times() -> Any:
    doc = "when the change to each further level begins, from the start on; one less than levels"
    return value(Items(Number(units.TIME)), doc, check=NON_NEGATIVE)


def _transition() -> Any:
    return number(units.TIME, "how long each change lasts", check=POSITIVE)


class Steps(Course):
    """Levels that are held, with rest-to-rest changes between them."""

    degree: int
    levels: tuple[Values, ...]
    times: tuple[float, ...]
    transition: float

    def __post_init__(self) -> None:
        check_fields(self, *self._problems())

    def _problems(self) -> Iterator[FieldProblem]:
        if len(self.times) != len(self.levels) - 1:
            expected = f"{len(self.levels) - 1}, one for each level but the first"
            yield FieldProblem(("times",), f"expected {expected}, found {len(self.times)}")
        for index, (before, after) in enumerate(pairwise(self.times), start=1):
            if not before + self.transition <= after * (1 + SAME_TIME):
                message = f"{after:g} s is before the change that begins at {before:g} s ends"
                yield FieldProblem(("times", index), f"{message}, {self.transition:g} s later")

    def problems_over(self, duration: float) -> Iterator[FieldProblem]:
        """What keeps it from lasting so long, in s."""
        end = self.times[-1] + self.transition
        if not end <= duration * (1 + SAME_TIME):
            message = f"the last change ends at {end:.10g} s, the trajectory at {duration:.10g} s"
            yield FieldProblem(("times", len(self.times) - 1), message)
        else:
            yield from super().problems_over(duration)

    def over(self, span: tuple[float, float]) -> Chain:
        """The profile from the first to the last time of a span, in s."""
        starts = [span[0] + time for time in self.times]
        ends = [
            min(start + self.transition, after) for start, after in pairwise([*starts, span[1]])
        ]  # rounding must not make them overlap
        levels, changes = list(map(numbers, self.levels)), list(zip(starts, ends, strict=True))
        return stepwise(self.signal, span, self.degree, levels, changes)


@dataclass(frozen=True)
class StiffnessSteps(Steps):
    """Levels that are held, with rest-to-rest changes from each to the next."""

    signal = STIFFNESS
    degree: int = _degree()
    levels: tuple[Values, ...] = value(
        Items(PerJoint(units.STIFFNESS)), "stiffnesses, the first from the start on", check=POSITIVE
    )
    times: tuple[float, ...] = _times()
    transition: float = _transition()


@dataclass(frozen=True)
class WrenchSteps(Steps, Framed):
    """Levels that are held, with rest-to-rest changes from each to the next."""

    signal = WRENCH
    degree: int = _degree()
    levels: tuple[tuple[float, ...], ...] = value(
        Items(Vector(6, units.WRENCH)), "wrenches `[fx, fy, fz, mx, my, mz]`, the first from the start on"
    )
    times: tuple[float, ...] = _times()
    transition: float = _transition()
