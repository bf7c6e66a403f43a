"""Motions one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem, InvalidRecordError
from vsacli.base.signals import POSITION
from vsacli.documents.fields import Items, OneOf, check_fields, value
from vsacli.trajectory.curves import ClosedForm
from vsacli.trajectory.curves.closed_form import LONGEST, SHORTEST
from vsacli.trajectory.curves.piecewise import Chain, Jump
from vsacli.trajectory.declared.course import Course
from vsacli.trajectory.declared.parts import PARTS, RIGID_PARTS, Dwell, Part


@dataclass(frozen=True)
class PositionSequence(Course):
    """Parts one after the other. Each begins as the one before ends, to the fourth derivative."""

    signal = POSITION
    smoothness: ClassVar[int] = 4
    remedy: ClassVar[str] = (
        "the motion must be four times continuously differentiable, so that parts meet at rest:"
        " take degree 9 or more, and a ramp for sinusoids"
    )
    parts: tuple[Part, ...] = value(Items(OneOf(PARTS)), "what happens, in this order")

    def __post_init__(self) -> None:
        check_fields(self)
        problems = list(self._problems()) or list(self._discontinuities())
        if problems:
            raise InvalidRecordError(type(self).__name__, problems)

    def _problems(self) -> Iterator[FieldProblem]:
        unfit = [
            problem.inside("parts", index)
            for index, part in enumerate(self.parts)
            for problem in part.own_problems()
        ]
        yield from unfit or self._order_problems()

    def _order_problems(self) -> Iterator[FieldProblem]:
        moving = [index for index, part in enumerate(self.parts) if not isinstance(part, Dwell)]
        if not moving:
            yield FieldProblem(("parts",), "no part moves; take `type: constant`")
        elif self.parts[moving[0]].begins is None:
            message = (
                "missing key 'start' (position at the start), since no part before says where the robot is"
            )
            yield FieldProblem(("parts", moving[0]), message)
        ends = self._ends()
        if not (ends[-1] <= LONGEST and np.all(np.diff(ends) >= SHORTEST)):
            durations = [part.lasts for part in self.parts]
            message = f"durations from {min(durations):g} to {max(durations):g} s cannot follow one another"
            yield FieldProblem(("parts",), message)

    def _discontinuities(self) -> Iterator[FieldProblem]:
        with np.errstate(all="ignore"):  # numbers that are too large are noticed elsewhere
            jumps = list(self.over((0.0, self.lasts)).jumps(self.smoothness + 1))
        for jump in jumps:
            part = ("parts", jump.part)
            if jump.order == 0:
                path = (*part, *self.parts[jump.part].opening, jump.component)
                yield FieldProblem(path, _elsewhere(jump, path), jump.component)
            else:
                name = self.signal.names[jump.order]
                change = f"{name} jumps from {jump.before:.4g} to {jump.after:.4g} where this part begins"
                yield FieldProblem(part, f"{change}; {self.remedy}", jump.component)

    def _ends(self) -> FloatArray:
        """Where the parts end, from the start of the first on, s; (parts+1,)."""
        with np.errstate(over="ignore"):  # an infinite sum is refused
            return np.concatenate(([0.0], np.cumsum([part.lasts for part in self.parts])))

    @property
    def lasts(self) -> float:
        """The sum of the durations, s."""
        return float(self._ends()[-1])

    def over(self, span: tuple[float, float]) -> Chain:
        """The profile from the first to the last time of a span, in s."""
        return Chain(signal=self.signal, span=span, parts=tuple(profile for _, profile in self._placed(span)))

    def _placed(self, span: tuple[float, float]) -> Iterator[tuple[Part, ClosedForm]]:
        """Each part with its profile."""
        ends = [*(span[0] + (span[1] - span[0]) * self._ends()[:-1] / self.lasts).tolist(), span[1]]
        here = next(part.begins for part in self.parts if part.begins is not None)
        for part, piece in zip(self.parts, pairwise(ends), strict=True):
            profile = part.placed(piece, here)
            here = tuple(profile.at(np.array(piece[1:]))[0, :, 0].tolist())
            yield part, profile

    def warnings_over(self, span: tuple[float, float], joints: Mapping[str, str], /) -> Iterator[str]:
        """Those of the parts."""
        for part, profile in self._placed(span):
            if isinstance(part, Course):
                yield from part.warnings_over(profile.span, joints)

    def notes_over(self, span: tuple[float, float], /) -> Iterator[str]:
        """Those of the parts."""
        for part, profile in self._placed(span):
            if isinstance(part, Course):
                yield from part.notes_over(profile.span)


def _elsewhere(jump: Jump, path: tuple[str | int, ...]) -> str:
    remedy = "leave this key out" if "start" in path else "begin there"
    return f"begins at {jump.after:.12g}, but the part before ends at {jump.before:.12g}; {remedy}"


@dataclass(frozen=True)
class RigidPositionSequence(PositionSequence):
    """The same for a robot whose joints are all rigid."""

    smoothness = 2
    remedy = (
        "the motion must be twice continuously differentiable, so that parts meet at rest:"
        " take degree 5 or more, and a ramp for sinusoids"
    )
    parts: tuple[Part, ...] = value(Items(OneOf(RIGID_PARTS)), "what happens, in this order")
