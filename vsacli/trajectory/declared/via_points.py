"""A spline through points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from vsacli.base import units
from vsacli.base.errors import FieldProblem
from vsacli.base.signals import POSITION
from vsacli.documents.fields import NON_NEGATIVE, Items, Number, integer, value
from vsacli.trajectory.curves import VIA_DEGREES
from vsacli.trajectory.curves.via_points import ViaPoints, passing_shares
from vsacli.trajectory.declared.declaration import Formula, Use, Values, numbers

OVERSHOOT = 0.1
"""Share of a joint's range of points beyond which it is said how far the spline goes further."""

MAX_POINTS = 1000
"""More are recorded samples, not points that somebody chose."""

SHOWN_TIMES = 12
"""Times that are printed; of more, the first and the last ones."""

_TIMES = (
    "when each point is passed, from the start on, the first 0; the duration follows from the last."
    " If absent, they follow from the distances of the points"
)


class Via(Formula):
    """A spline through points, at rest at both ends."""

    degree: int
    points: tuple[Values, ...]
    times: tuple[float, ...] | None

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """The declared fields by name."""
        degree = "degree of the spline"
        if use.signal is POSITION and not use.rigid:
            degree += "; from 3 on if all joints are rigid"
        return {
            "degree": integer(degree, check=use.degree(VIA_DEGREES)),
            "points": use.several(" to pass, from the first to the last"),
            "times": value(Items(Number(units.TIME)), _TIMES, check=NON_NEGATIVE, default=None),
        }

    @classmethod
    def meaning(cls, use: Use) -> str:
        """What it does, for users."""
        if use.rigid:
            return "The same for a robot whose joints are all rigid."
        what = "A spline through points, from rest to rest"
        if use.signal is POSITION:
            what += "; that of degree 7 has the least mean square snap"
        elif use.signal.positive:
            what = "A spline through points, which must stay positive between them"
        vanishing = "All derivatives up to (degree-1)/2 vanish at both ends"
        return f"{what}.\n\n{vanishing}, those up to degree-1 are continuous."

    def _problems(self) -> Iterator[FieldProblem]:
        if not 2 <= len(self.points) <= MAX_POINTS:
            message = f"expected 2 to {MAX_POINTS} points, found {len(self.points)}"
            yield FieldProblem(("points",), message)
        elif self.times is None:
            for index, (before, after) in enumerate(pairwise(self.points), start=1):
                if before == after:
                    message = f"point {index + 1} is the one before again; give times to pass it twice"
                    yield FieldProblem(("points", index), message)
        else:
            yield from self._time_problems(self.times)

    def _time_problems(self, times: tuple[float, ...]) -> Iterator[FieldProblem]:
        if len(times) != len(self.points):
            message = f"expected {len(self.points)}, one for each point, found {len(times)}"
            yield FieldProblem(("times",), message)
        if times and times[0] != 0:
            yield FieldProblem(
                ("times", 0), f"the first must be 0, not {times[0]:g}: it counts from the start"
            )
        for index, (before, after) in enumerate(pairwise(times), start=1):
            if not before < after:
                message = f"must increase strictly, but {after:g} follows {before:g}"
                yield FieldProblem(("times", index), message)

    @property
    def lasts(self) -> float | None:
        """The last of the times, s."""
        return None if self.times is None else self.times[-1]

    def over(self, span: tuple[float, float]) -> ViaPoints:
        """The profile from the first to the last time of a span, in s."""
        points = tuple(map(numbers, self.points))
        if self.times is None:
            shares = passing_shares(points, self.degree)
        else:
            shares = np.array(self.times) / self.times[-1]
        return ViaPoints(
            signal=self.signal, span=span, degree=self.degree, shares=tuple(shares.tolist()), points=points
        )

    def problems_over(self, duration: float) -> Iterator[FieldProblem]:
        """What keeps it from lasting so long, in s."""
        problems = list(super().problems_over(duration))
        yield from problems
        if problems or not self.signal.positive:
            return
        lowest, when, *_ = self.over((0.0, duration)).extremes()
        for joint in np.flatnonzero(lowest <= 0).tolist():
            fall = f"the spline through them falls to {lowest[joint]:.4g} after {when[joint]:.3f} s"
            message = f"{fall}, but must stay positive; add a point there, or give other times"
            yield FieldProblem(("points",), message, joint)

    def notes_over(self, span: tuple[float, float], /) -> Iterator[str]:
        """Times that were derived."""
        if self.times is None:
            yield f"passes its via points at t = {_listed(self.over(span).breakpoints.tolist())} s"

    def warnings_over(self, span: tuple[float, float], joints: Mapping[str, str], /) -> Iterator[str]:
        """Where the spline goes far beyond its points."""
        profile = self.over(span)
        for name, joint_type, points, *extremes in zip(
            joints, joints.values(), np.transpose(profile.points), *profile.extremes(), strict=True
        ):
            lowest, lowest_at, highest, highest_at = extremes
            further, when = max((points.min() - lowest, lowest_at), (highest - points.max(), highest_at))
            if further > OVERSHOOT * np.ptp(points):
                unit = self.signal.quantities[0].unit(joint_type)
                yield f"{name} goes {further:.3g} {unit} beyond its via points, at t = {when:.3f} s"


def _listed(times: list[float]) -> str:
    shown = [f"{time:.4g}" for time in times]
    if len(shown) > SHOWN_TIMES:
        half = SHOWN_TIMES // 2
        shown[half:-half] = ["..."]
    return ", ".join(shown)
