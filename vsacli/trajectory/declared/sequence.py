"""Motions one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem, InvalidRecordError
from vsacli.documents.fields import Items, OneOf, check_fields, value
from vsacli.trajectory.curves import ClosedForm
from vsacli.trajectory.curves.closed_form import LONGEST, SHORTEST
from vsacli.trajectory.curves.piecewise import Chain, Jump
from vsacli.trajectory.declared.declaration import Formula, Use
from vsacli.trajectory.declared.parts import PARTS, Dwell, Part


class Sequence(Formula):
    """Parts one after the other. Each begins as the one before ends, to the fourth derivative."""

    parts: tuple[Part, ...]

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """The declared fields by name."""
        parts = {name: part.record(use) for name, part in PARTS.items()}
        return {"parts": value(Items(OneOf(parts)), "what happens, in this order")}

    @classmethod
    def meaning(cls, use: Use) -> str:
        """What it does, for users."""
        return "The same for a robot whose joints are all rigid." if use.rigid else super().meaning(use)

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
            jumps = list(self.over((0.0, self.lasts)).jumps(self.use.smoothness + 1))
        for jump in jumps:
            part = ("parts", jump.part)
            if jump.order == 0:
                path = (*part, *self.parts[jump.part].opening, jump.component)
                yield FieldProblem(path, _elsewhere(jump, path), jump.component)
            else:
                name = self.signal.names[jump.order]
                change = f"{name} jumps from {jump.before:.4g} to {jump.after:.4g} where this part begins"
                yield FieldProblem(part, f"{change}; {self._remedy()}", jump.component)

    def _remedy(self) -> str:
        smooth = "twice" if self.use.rigid else "four times"
        remedy = f"the motion must be {smooth} continuously differentiable, so that parts meet at rest"
        return f"{remedy}: take degree {2 * self.use.smoothness + 1} or more, and a ramp for sinusoids"

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
            if isinstance(part, Formula):
                yield from part.warnings_over(profile.span, joints)

    def notes_over(self, span: tuple[float, float], /) -> Iterator[str]:
        """Those of the parts."""
        for part, profile in self._placed(span):
            if isinstance(part, Formula):
                yield from part.notes_over(profile.span)


def _elsewhere(jump: Jump, path: tuple[str | int, ...]) -> str:
    remedy = "leave this key out" if "start" in path else "begin there"
    return f"begins at {jump.after:.12g}, but the part before ends at {jump.before:.12g}; {remedy}"
