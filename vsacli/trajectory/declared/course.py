"""What all courses have in common."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from typing import ClassVar, TypeAlias

import numpy as np

from vsacli.base.errors import FieldProblem, InputError
from vsacli.base.signals import Signal
from vsacli.trajectory.curves import ClosedForm

SAME_TIME = 1e-9
"""Times whose difference is a smaller share than this are the same, but for rounding in a file."""

Values: TypeAlias = tuple[float | None, ...]
"""A number for each joint or axis, None for joints without stiffness."""


class Course(ABC):
    """How position, stiffness or wrench goes on over time, as declared in a trajectory file."""

    signal: ClassVar[Signal]

    @property
    def lasts(self) -> float | None:
        """The duration that follows from what is declared, s; None if any will do."""
        return None

    @abstractmethod
    def over(self, span: tuple[float, float]) -> ClosedForm:
        """The profile from the first to the last time of a span, in s."""

    def problems_over(self, duration: float) -> Iterator[FieldProblem]:
        """What keeps it from lasting so long, in s."""
        if self.lasts is not None and not same_time(self.lasts, duration):
            yield FieldProblem((), f"lasts {self.lasts:.10g} s, but the trajectory {duration:.10g} s")
            return
        try:
            self.over((0.0, duration)).at(np.zeros(1))
        except InputError as error:
            yield FieldProblem((), str(error))

    def warnings_over(self, _span: tuple[float, float], _joints: Mapping[str, str], /) -> Iterator[str]:
        """Why it may not be what was meant over a span, in clauses.

        Args:
            _span: in s.
            _joints: name and type of each.
        """
        return iter(())

    def notes_over(self, _span: tuple[float, float], /) -> Iterator[str]:
        """What follows from it over a span, in s, that the user did not give, in clauses."""
        return iter(())


def same_time(one: float, other: float) -> bool:
    """Whether two times are the same but for rounding."""
    return math.isclose(one, other, rel_tol=SAME_TIME)


def numbers(values: Values) -> tuple[float, ...]:
    """NaN in place of None."""
    return tuple(math.nan if value is None else value for value in values)
