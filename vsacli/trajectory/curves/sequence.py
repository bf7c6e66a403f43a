"""Sequences of motions, declared in files; each part begins where the previous one ends."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any, ClassVar, TypeAlias

import numpy as np

from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.base.signals import POSITION
from vsacli.documents.fields import POSITIVE, Items, OneOf, integer, number, value
from vsacli.trajectory.curves.closed_form import (
    DEGREES,
    MAX_DURATION,
    MIN_DURATION,
    ClosedForm,
    ConstantProfile,
    Declaration,
    Formula,
    Use,
    same_time,
)
from vsacli.trajectory.curves.polynomial import RestToRest
from vsacli.trajectory.curves.sinusoids import SumOfSinusoids
from vsacli.trajectory.curves.steps import Jump, PiecewiseProfile
from vsacli.trajectory.curves.via_points import Via

Position: TypeAlias = tuple[float, ...]


class _RobotIndependent(Declaration):
    """A declaration that means the same for robots whose joints are all rigid, though with other degrees."""

    @classmethod
    def meaning(cls, use: Use) -> str:
        """Return the meaning for users."""
        return "The same for a robot whose joints are all rigid." if use.rigid else cls.__doc__ or ""


class SequencePart(Declaration):
    """A motion with a duration of its own, whose start may follow from the previous part."""

    opening: ClassVar[tuple[str | int, ...]]
    """Path of the field that declares the position at the start."""

    @property
    @abstractmethod
    def lasts(self) -> float:
        """Duration, s."""

    @property
    @abstractmethod
    def begins(self) -> Position | None:
        """Position at the start; None if it is the end of the previous part."""

    @abstractmethod
    def placed(self, span: tuple[float, float], start_position: Position) -> ClosedForm:
        """Return the profile over a span, s, after a part that ends at position `start_position`."""

    def own_problems(self) -> Iterator[FieldProblem]:
        """Yield the problems of the part alone."""
        return iter(())


class _Timed(SequencePart):
    """A part with a required duration."""

    duration: float

    @classmethod
    def fields(cls, _use: Use) -> dict[str, Any]:
        """Return the declared fields by name."""
        return {"duration": number(units.TIME, "duration of the part", check=POSITIVE)}

    @property
    def lasts(self) -> float:
        """Duration, s."""
        return self.duration


class Dwell(_Timed):
    """The robot stands still where the part before ends; at the beginning, where the next part starts."""

    opening = ()
    begins = None

    def placed(self, span: tuple[float, float], start_position: Position) -> ConstantProfile:
        """See `SequencePart.placed`."""
        return ConstantProfile(signal=POSITION, span=span, value=start_position)


class PolynomialPart(_RobotIndependent, _Timed):
    """Rest to rest: all derivatives up to (degree-1)/2 vanish at both ends."""

    opening = ("start",)
    degree: int
    start: Position | None
    end: Position

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """Return the declared fields by name."""
        degree = "degree of the polynomial"
        if not use.rigid:
            degree += ": from 9 on next to another part; from 5 on if all joints are rigid"
        return {
            **super().fields(use),
            "degree": integer(degree, check=use.degree(DEGREES)),
            "start": use.one("at the start; where the part before ends, if absent", default=None),
            "end": use.one("at the end"),
        }

    @property
    def begins(self) -> Position | None:
        """See `SequencePart.begins`."""
        return self.start

    def placed(self, span: tuple[float, float], start_position: Position) -> RestToRest:
        """See `SequencePart.placed`."""
        start = start_position if self.start is None else self.start
        return RestToRest(signal=POSITION, span=span, degree=self.degree, start=start, end=self.end)


class _Standalone(Formula, SequencePart):
    """A formula that is also a part; its start does not depend on the previous part."""

    @property
    @abstractmethod
    def lasts(self) -> float:
        """Duration, s."""

    @property
    def begins(self) -> Position:
        """Position at the start."""
        return tuple(self.profile_over((0.0, self.lasts)).at(np.zeros(1))[0, :, 0].tolist())

    def placed(self, span: tuple[float, float], _start_position: Position) -> ClosedForm:
        """See `SequencePart.placed`."""
        return self.profile_over(span)

    def own_problems(self) -> Iterator[FieldProblem]:
        """See `SequencePart.own_problems`."""
        return self.problems_over(self.lasts)


class ViaPart(_RobotIndependent, Via, _Standalone):
    """A spline through points as above."""

    opening = ("points", 0)
    duration: float | None

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """Return the declared fields by name."""
        doc = "duration of the part; absent if times are given"
        return {**super().fields(use), "duration": number(units.TIME, doc, check=POSITIVE, default=None)}

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
        """Duration, s."""
        duration = self.duration if self.times is None else self.times[-1]
        assert duration is not None, "see `_problems`"
        return duration


class SinusoidsPart(SumOfSinusoids, _Timed, _Standalone):
    """A sum of sinusoids as above; it needs a `ramp` where another part precedes or follows."""

    opening = ("offset",)

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """Return the declared fields by name."""
        return {**super().fields(use), **_Timed.fields(use)}


PARTS: dict[str, type[SequencePart]] = {
    "polynomial": PolynomialPart,
    "via": ViaPart,
    "sinusoids": SinusoidsPart,
    "dwell": Dwell,
}


class Sequence(_RobotIndependent, Formula):
    """Parts one after the other. Each begins as the one before ends, to the fourth derivative."""

    parts: tuple[SequencePart, ...]

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """Return the declared fields by name."""
        parts = {name: part.record(use) for name, part in PARTS.items()}
        return {"parts": value(Items(OneOf(parts)), "parts in temporal order")}

    def _problems(self) -> list[FieldProblem]:
        unfit = [
            problem.inside("parts", index)
            for index, part in enumerate(self.parts)
            for problem in part.own_problems()
        ]
        return unfit or list(self._order_problems()) or list(self._discontinuities())

    def _order_problems(self) -> Iterator[FieldProblem]:
        moving_indices = [index for index, part in enumerate(self.parts) if not isinstance(part, Dwell)]
        if not moving_indices:
            yield FieldProblem(("parts",), "no part moves; take `type: constant`")
        elif self.parts[moving_indices[0]].begins is None:
            message = (
                "missing key 'start' (position at the start), since no part before says where the robot is"
            )
            yield FieldProblem(("parts", moving_indices[0]), message)
        ends = self._part_ends()
        if not (ends[-1] <= MAX_DURATION and np.all(np.diff(ends) >= MIN_DURATION)):
            durations = [part.lasts for part in self.parts]
            message = f"durations from {min(durations):g} to {max(durations):g} s cannot follow one another"
            yield FieldProblem(("parts",), message)

    def _discontinuities(self) -> Iterator[FieldProblem]:
        with np.errstate(all="ignore"):  # too large numbers are reported elsewhere
            jumps = list(self.profile_over((0.0, self.lasts)).jumps(self.use.smoothness + 1))
        for jump in jumps:
            part = ("parts", jump.part)
            if jump.order == 0:
                path = (*part, *self.parts[jump.part].opening, jump.component)
                yield FieldProblem(path, _describe_gap(jump, path), jump.component)
            else:
                name = self.signal.names[jump.order]
                jump_text = f"{name} jumps from {jump.before:.4g} to {jump.after:.4g} where this part begins"
                yield FieldProblem(part, f"{jump_text}; {self._smoothness_advice()}", jump.component)

    def _smoothness_advice(self) -> str:
        smoothness_text = "twice" if self.use.rigid else "four times"
        advice = (
            f"the motion must be {smoothness_text} continuously differentiable, so that parts meet at rest"
        )
        return f"{advice}: take degree {2 * self.use.smoothness + 1} or more, and a ramp for sinusoids"

    def _part_ends(self) -> FloatArray:
        """Return start and ends of the parts, from zero on, s, (parts+1,)."""
        with np.errstate(over="ignore"):  # an infinite sum is refused
            return np.concatenate(([0.0], np.cumsum([part.lasts for part in self.parts])))

    @property
    def lasts(self) -> float:
        """Sum of the durations, s."""
        return float(self._part_ends()[-1])

    def profile_over(self, span: tuple[float, float]) -> PiecewiseProfile:
        """See `Formula.profile_over`."""
        return PiecewiseProfile(
            signal=self.signal, span=span, parts=tuple(profile for _, profile in self._placed_parts(span))
        )

    def _placed_parts(self, span: tuple[float, float]) -> Iterator[tuple[SequencePart, ClosedForm]]:
        part_ends = [*(span[0] + (span[1] - span[0]) * self._part_ends()[:-1] / self.lasts).tolist(), span[1]]
        start_position = next(part.begins for part in self.parts if part.begins is not None)
        for part, part_span in zip(self.parts, pairwise(part_ends), strict=True):
            profile = part.placed(part_span, start_position)
            start_position = tuple(profile.at(np.array(part_span[1:]))[0, :, 0].tolist())
            yield part, profile

    def warnings_over(self, span: tuple[float, float], joints: Mapping[str, str], /) -> Iterator[str]:
        """Yield the warnings of the parts."""
        for part, profile in self._placed_parts(span):
            if isinstance(part, Formula):
                yield from part.warnings_over(profile.span, joints)

    def notes_over(self, span: tuple[float, float], /) -> Iterator[str]:
        """Yield the notes of the parts."""
        for part, profile in self._placed_parts(span):
            if isinstance(part, Formula):
                yield from part.notes_over(profile.span)


def _describe_gap(jump: Jump, path: tuple[str | int, ...]) -> str:
    advice = "leave this key out" if "start" in path else "begin there"
    return f"begins at {jump.after:.12g}, but the part before ends at {jump.before:.12g}; {advice}"
