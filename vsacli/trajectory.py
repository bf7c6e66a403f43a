"""The trajectory a robot is asked to execute: motion and stiffness at any block of its steps."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

import numpy as np
import numpy.typing as npt

from vsacli.arrays import FloatArray, over_time
from vsacli.errors import InputError, Problem
from vsacli.motion import Motion
from vsacli.profiles import POSITION, STIFFNESS
from vsacli.samples import SampledProfile, checked_array, time_problems, value_problems
from vsacli.spec.source import Source
from vsacli.times import RecordedTimes, Times


class Profile(Protocol):
    """A function of time with one component a joint, and its first derivatives."""

    @property
    def joints(self) -> int:
        """Number of joints."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know about where the values come from."""

    @property
    def breakpoints(self) -> FloatArray:
        """Ascending times between which the function is analytic; the first and last are its span."""

    def at(self, time: FloatArray) -> FloatArray:
        """Value and derivatives at any times of the span, shape (orders, joints, samples)."""

    def samples(self, start: int, stop: int, time: FloatArray, /) -> FloatArray:
        """The same at the steps start..stop-1, whose times are `time`; given columns pass through."""

    def stretched(self, factor: float) -> Profile:
        """The same course, slower by a factor, from the same first time on."""


class Trajectory:
    """Motion and stiffness of all joints over the same times.

    Attributes:
        times: the steps.
        position, stiffness: what happens at them and between them.
        name: used in reports and for the name of the result file.
        warnings: what the user should know about times and profiles.
        sources: the files it was read from.
    """

    def __init__(
        self,
        times: Times,
        position: Profile,
        stiffness: Profile,
        *,
        name: str,
        warnings: Iterable[str] = (),
        sources: Iterable[Source] = (),
    ) -> None:
        """Join profiles that have the same joints and the span of the times.

        Raises:
            InputError: they have not.
        """
        self.times, self.position, self.stiffness = times, position, stiffness
        self.name = name
        self.warnings = (*warnings, *times.warnings, *position.warnings, *stiffness.warnings)
        self.sources = tuple(sources)
        self._check()

    def _check(self) -> None:
        if self.position.joints != self.stiffness.joints:
            joints = f"{self.position.joints} joints, the stiffness {self.stiffness.joints}"
            raise InputError.one(f"the position has {joints}")
        first, last = self.times.span
        for part, profile in (("position", self.position), ("stiffness", self.stiffness)):
            start, end = profile.breakpoints[[0, -1]]
            if (start, end) != (first, last):
                raise InputError.one(
                    f"the {part} spans {start:g} to {end:g} s, the steps {first:g} to {last:g} s"
                )

    @classmethod
    def from_samples(
        cls,
        time: npt.ArrayLike,
        q: npt.ArrayLike,
        stiffness: npt.ArrayLike,
        *,
        dq: npt.ArrayLike | None = None,
        ddq: npt.ArrayLike | None = None,
        d3q: npt.ArrayLike | None = None,
        d4q: npt.ArrayLike | None = None,
        dstiffness: npt.ArrayLike | None = None,
        ddstiffness: npt.ArrayLike | None = None,
        name: str = "samples",
    ) -> Trajectory:
        """A trajectory through samples; derivatives that are given are used at the samples as they are.

        Those that are not come from a spline through the values: degree 5 (C4) for q, cubic (C2) for the
        stiffness. `at` evaluates these splines in any case.

        Args:
            time: (samples,) in s, strictly increasing, at least 6.
            q: position, (samples, joints), rad (m), as are its derivatives per s^k.
            stiffness: joint stiffness, (samples, joints), N m/rad (N/m), as are its derivatives per s^k.
            dq: first derivative of q.
            ddq: second derivative of q.
            d3q: third derivative of q.
            d4q: fourth derivative of q.
            dstiffness: first derivative of the stiffness.
            ddstiffness: second derivative of the stiffness.
            name: used in reports and for the name of the result file.

        Raises:
            InputError: naming each array that does not fit, by index.
        """
        times = checked_array("time", time, None)
        position = SampledProfile.from_arrays(POSITION, times, q, dq, ddq, d3q, d4q)
        stiffnesses = SampledProfile.from_arrays(STIFFNESS, times, stiffness, dstiffness, ddstiffness)
        problems = [*time_problems(times), *value_problems(position), *value_problems(stiffnesses)]
        if problems:
            raise InputError(Problem("", 0, str(problem)) for problem in problems)
        return cls(RecordedTimes(times), position, stiffnesses, name=name)

    @property
    def joints(self) -> int:
        """Number of joints."""
        return self.position.joints

    @property
    def samples(self) -> int:
        """Number of steps, both ends included."""
        return self.times.samples

    @property
    def duration(self) -> float:
        """Time from the first step to the last, s."""
        first, last = self.times.span
        return last - first

    def block(self, start: int, stop: int) -> Motion:
        """The steps start..stop-1; like a slice, it ends where the steps end."""
        time = self.times.block(start, stop)
        return _motion(
            time, self.position.samples(start, stop, time), self.stiffness.samples(start, stop, time)
        )

    def at(self, time: FloatArray) -> Motion:
        """The smooth functions at any times of the span, (samples,); given derivatives play no part."""
        return _motion(time, self.position.at(time), self.stiffness.at(time))

    def stretched(self, factor: float) -> Trajectory:
        """Position and stiffness slower by a factor; steps at a uniform rate keep their rate."""
        return Trajectory(
            self.times.stretched(factor),
            self.position.stretched(factor),
            self.stiffness.stretched(factor),
            name=self.name,
            sources=self.sources,
        )

    def check_points(self, count: int) -> tuple[FloatArray, FloatArray]:
        """`count` times all over the span at which the derivatives can be checked by finite differences.

        Returns:
            Times (count,), respaced evenly within the pieces of the functions that evenly spread times fall
            into, and for each the distance to the nearest end of its piece, within which all is analytic.
        """
        ends = np.union1d(self.position.breakpoints, self.stiffness.breakpoints)
        spread = ends[0] + self.duration * (np.arange(count) + 0.5) / count
        piece, which, hits = np.unique(
            np.searchsorted(ends, spread, side="right") - 1, return_inverse=True, return_counts=True
        )
        rank = np.arange(count) - (np.cumsum(hits) - hits)[which]
        left, right = ends[piece][which], ends[piece + 1][which]
        time = left + (right - left) * (rank + 0.5) / hits[which]
        return time, np.minimum(time - left, right - time)


def _motion(time: FloatArray, position: FloatArray, stiffness: FloatArray) -> Motion:
    return Motion(time, *(over_time(rows) for rows in (*position, *stiffness)))
