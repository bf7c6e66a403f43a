"""Levels that are held, with rest-to-rest changes between them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from vsacli.base import units
from vsacli.base.errors import FieldProblem
from vsacli.base.signals import WRENCH
from vsacli.documents.fields import NON_NEGATIVE, POSITIVE, Items, Number, integer, number, value
from vsacli.trajectory.curves import DEGREES
from vsacli.trajectory.curves.piecewise import Chain, stepwise
from vsacli.trajectory.declared.declaration import SAME_TIME, Formula, Use, Values, numbers, odd
from vsacli.trajectory.declared.polynomial import AXES

_SMOOTH = (
    "it must be twice continuously differentiable, so two derivatives must vanish where it begins to change"
)


class Steps(Formula):
    """Levels that are held, with rest-to-rest changes from each to the next."""

    degree: int
    levels: tuple[Values, ...]
    times: tuple[float, ...]
    transition: float

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """The declared fields by name."""
        degree = "degree of the polynomials that lead from level to level"
        times = "when the change to each further level begins, from the start on; one less than levels"
        axes = f" {AXES.removeprefix(', ')}" if use.signal is WRENCH else ""
        return {
            **use.frame(),
            "degree": integer(degree, check=odd(DEGREES, 2 * use.smoothness + 1, _SMOOTH)),
            "levels": use.several(f"{axes}, the first from the start on"),
            "times": value(Items(Number(units.TIME)), times, check=NON_NEGATIVE),
            "transition": number(units.TIME, "how long each change lasts", check=POSITIVE),
        }

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
