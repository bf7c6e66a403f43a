"""Parts of a sequence."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from typing import Any, ClassVar, TypeAlias

import numpy as np

from vsacli.base import units
from vsacli.base.errors import FieldProblem
from vsacli.base.signals import POSITION
from vsacli.documents.fields import POSITIVE, integer, number
from vsacli.trajectory.curves import DEGREES, ClosedForm, Constant, RestToRest
from vsacli.trajectory.declared.declaration import Declaration, Formula, Use, same_time
from vsacli.trajectory.declared.sinusoids import SumOfSinusoids
from vsacli.trajectory.declared.via_points import Via

Position: TypeAlias = tuple[float, ...]


class Part(Declaration):
    """A motion with a duration of its own; what is declared may leave open where it begins."""

    opening: ClassVar[tuple[str | int, ...]]
    """Path to where the position at its start is declared."""

    @property
    @abstractmethod
    def lasts(self) -> float:
        """The duration, s."""

    @property
    @abstractmethod
    def begins(self) -> Position | None:
        """The position at the start; None if it is where the part before ends."""

    @abstractmethod
    def placed(self, span: tuple[float, float], here: Position) -> ClosedForm:
        """The profile over a span, in s, after a part that ends here."""

    def own_problems(self) -> Iterator[FieldProblem]:
        """What keeps it from being executed."""
        return iter(())


class _Timed(Part):
    """A part with a required duration."""

    duration: float

    @classmethod
    def fields(cls, _use: Use) -> dict[str, Any]:
        """The declared fields by name."""
        return {"duration": number(units.TIME, "duration of the part", check=POSITIVE)}

    @property
    def lasts(self) -> float:
        """The duration, s."""
        return self.duration


class Dwell(_Timed):
    """The robot stands still where the part before ends; at the beginning, where the next part starts."""

    opening = ()
    begins = None

    def placed(self, span: tuple[float, float], here: Position) -> Constant:
        """The profile over a span, in s, after a part that ends here."""
        return Constant(signal=POSITION, span=span, value=here)


class PolynomialPart(_Timed):
    """Rest to rest: all derivatives up to (degree-1)/2 vanish at both ends."""

    opening = ("start",)
    degree: int
    start: Position | None
    end: Position

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """The declared fields by name."""
        degree = "degree of the polynomial"
        if not use.rigid:
            degree += ": from 9 on next to another part; from 5 on if all joints are rigid"
        return {
            **super().fields(use),
            "degree": integer(degree, check=use.degree(DEGREES)),
            "start": use.one("at the start; where the part before ends, if absent", default=None),
            "end": use.one("at the end"),
        }

    @classmethod
    def meaning(cls, use: Use) -> str:
        """What it does, for users."""
        return "The same for a robot whose joints are all rigid." if use.rigid else super().meaning(use)

    @property
    def begins(self) -> Position | None:
        """The position at the start; None if it is where the part before ends."""
        return self.start

    def placed(self, span: tuple[float, float], here: Position) -> RestToRest:
        """The profile over a span, in s, after a part that ends here."""
        start = here if self.start is None else self.start
        return RestToRest(signal=POSITION, span=span, degree=self.degree, start=start, end=self.end)


class _Standalone(Formula, Part):
    """A formula that is a part as well: it knows by itself where it begins."""

    @property
    @abstractmethod
    def lasts(self) -> float:
        """The duration, s."""

    @property
    def begins(self) -> Position:
        """The position at the start."""
        start: Position = tuple(self.over((0.0, self.lasts)).at(np.zeros(1))[0, :, 0].tolist())
        return start

    def placed(self, span: tuple[float, float], _here: Position) -> ClosedForm:
        """The profile over a span, in s."""
        return self.over(span)

    def own_problems(self) -> Iterator[FieldProblem]:
        """What keeps it from being executed."""
        return self.problems_over(self.lasts)


class ViaPart(Via, _Standalone):
    """A spline through points as above."""

    opening = ("points", 0)
    duration: float | None

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """The declared fields by name."""
        doc = "duration of the part, if there are no times"
        return {**super().fields(use), "duration": number(units.TIME, doc, check=POSITIVE, default=None)}

    @classmethod
    def meaning(cls, use: Use) -> str:
        """What it does, for users."""
        return "The same for a robot whose joints are all rigid." if use.rigid else cls.__doc__ or ""

    def _problems(self) -> Iterator[FieldProblem]:
        yield from super()._problems()
        if self.duration is None and self.times is None:
            yield FieldProblem((), "missing key 'duration' or 'times' (s)")
        elif self.duration is not None and self.times and not same_time(self.duration, self.times[-1]):
            message = (
                f"is {self.duration:.10g} s, but the last of the times {self.times[-1]:.10g} s; leave it out"
            )
            yield FieldProblem(("duration",), message)

    @property
    def lasts(self) -> float:
        """The duration, s."""
        duration = self.duration if self.times is None else self.times[-1]
        assert duration is not None, "see _problems"
        return duration


class SinusoidsPart(SumOfSinusoids, _Standalone):
    """A sum of sinusoids as above; it needs a `ramp` where another part precedes or follows."""

    opening = ("offset",)
    duration: float

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """The declared fields by name."""
        duration = number(units.TIME, "duration of the part", check=POSITIVE)
        return {**super().fields(use), "duration": duration}

    @property
    def lasts(self) -> float:
        """The duration, s."""
        return self.duration


PARTS: dict[str, type[Part]] = {
    "polynomial": PolynomialPart,
    "via": ViaPart,
    "sinusoids": SinusoidsPart,
    "dwell": Dwell,
}
