"""The trajectory a robot is asked to execute: motion, stiffness and wrench at any block of its steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, over_time
from vsacli.base.errors import InputError, Problem
from vsacli.base.wrench import WRENCH_AXES, Wrench, check_frame
from vsacli.documents.source import Source
from vsacli.trajectory.curves import POSITION, STIFFNESS, WRENCH, Constant, Signal
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.times import RecordedTimes, Times

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from vsacli.trajectory.recorded.samples import Samples


class Profile(Protocol):
    """A function of time with one component a joint or axis, and its first derivatives."""

    @property
    def components(self) -> int:
        """Number of components: one a joint, or six of a wrench."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Why the values, or some of them, may not be what was meant."""

    @property
    def notes(self) -> tuple[str, ...]:
        """How they were understood, where that is not obvious."""

    @property
    def breakpoints(self) -> FloatArray:
        """Ascending times between which the function is analytic; the first and last are its span."""

    def at(self, time: FloatArray) -> FloatArray:
        """Value and derivatives at any times of the span, shape (orders, components, samples)."""

    def samples(self, start: int, stop: int, time: FloatArray, /) -> FloatArray:
        """The same at the steps start..stop-1, whose times are `time`; given columns pass through."""

    def stretched(self, factor: float) -> Profile:
        """The same course, slower by a factor, from the same first time on."""

    def summary(self) -> dict[str, Any] | None:
        """The spline that values at the steps come from, in JSON values; None if they come from none."""


@dataclass(frozen=True)
class WrenchProfile:
    """What the environment exerts on the end effector, over time.

    Attributes:
        profile: force and moment about the origin of the tool frame, `WRENCH_AXES`, N and N m.
        frame: along whose axes these are, "end_effector" or "base".
    """

    profile: Profile
    frame: str = "end_effector"

    def __post_init__(self) -> None:
        check_frame(self.frame)
        if self.profile.components != len(WRENCH_AXES):
            expected = f"{len(WRENCH_AXES)} ({', '.join(WRENCH_AXES)})"
            raise InputError.one(f"the wrench has {self.profile.components} components, not {expected}")

    def stretched(self, factor: float) -> WrenchProfile:
        """The same course, slower by a factor, from the same first time on."""
        return replace(self, profile=self.profile.stretched(factor))


class Trajectory:
    """Motion and stiffness of all joints, and the wrench at the end effector, over the same times.

    Attributes:
        times: the steps.
        position, stiffness: what happens at them and between them; the stiffness of a joint for which none is
            chosen is NaN.
        wrench: what the environment exerts meanwhile; None if nothing.
        name: used in reports and for the name of the result file.
        warnings: why times and profiles may not be what was meant.
        notes: how they were understood, where that is not obvious.
        sources: the files it was read from.
    """

    def __init__(
        self,
        times: Times,
        position: Profile,
        stiffness: Profile,
        *,
        wrench: WrenchProfile | None = None,
        name: str,
        warnings: Iterable[str] = (),
        notes: Iterable[str] = (),
        sources: Iterable[Source] = (),
    ) -> None:
        """Join profiles that have the same joints and the span of the times.

        Raises:
            InputError: they have not.
        """
        self.times, self.position, self.stiffness, self.wrench = times, position, stiffness, wrench
        self.name = name
        profiles = [profile for _, profile in self._profiles()]
        self.warnings = (*warnings, *(each for profile in profiles for each in profile.warnings))
        self.notes = (*notes, *times.notes, *(each for profile in profiles for each in profile.notes))
        self.sources = tuple(sources)
        self._check()

    def _profiles(self) -> Iterator[tuple[str, Profile]]:
        yield "position", self.position
        yield "stiffness", self.stiffness
        if self.wrench is not None:
            yield "wrench", self.wrench.profile

    def _check(self) -> None:
        if self.position.components != self.stiffness.components:
            joints = f"{self.position.components} joints, the stiffness {self.stiffness.components}"
            raise InputError.one(f"the position has {joints}")
        first, last = self.times.span
        for part, profile in self._profiles():
            start, end = profile.breakpoints[[0, -1]]
            if (start, end) != (first, last):
                raise InputError.one(
                    f"the {part} spans {start:g} to {end:g} s, the steps {first:g} to {last:g} s"
                )

    @classmethod
    def from_samples(
        cls,
        time: ArrayLike,
        q: ArrayLike,
        stiffness: ArrayLike | None = None,
        *,
        dq: ArrayLike | None = None,
        ddq: ArrayLike | None = None,
        d3q: ArrayLike | None = None,
        d4q: ArrayLike | None = None,
        dstiffness: ArrayLike | None = None,
        ddstiffness: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
        dwrench: ArrayLike | None = None,
        ddwrench: ArrayLike | None = None,
        wrench_frame: str = "end_effector",
        fit: str | None = None,
        name: str = "samples",
    ) -> Trajectory:
        """A trajectory through samples; derivatives that are given are used at the samples as they are.

        Those that are not come from splines: degree 7 (C6) for q, degree 5 (C4) for the stiffness and the
        wrench. `at` evaluates these splines in any case.

        Args:
            time: (samples,) in s, strictly increasing, at least 8.
            q: position, (samples, joints), rad (m), as are its derivatives per s^k.
            stiffness: joint stiffness, (samples, joints), N m/rad (N/m), as are its derivatives per s^k. Only
                that of antagonistic joints counts; others may have NaN, and None will do if there are none.
            dq: first derivative of q.
            ddq: second derivative of q.
            d3q: third derivative of q.
            d4q: fourth derivative of q.
            dstiffness: first derivative of the stiffness.
            ddstiffness: second derivative of the stiffness.
            wrench: what the environment exerts on the end effector, (samples, 6): force and moment about the
                origin of the tool frame, N and N m, as are its derivatives per s^k; None if nothing.
            dwrench: first derivative of its components.
            ddwrench: second derivative of its components.
            wrench_frame: along whose axes the components are, "end_effector" or "base".
            fit: the splines, "interpolate": through the samples, or "lsq": near noisy ones by least squares,
                with knots by generalised cross-validation; then the values are those of the spline too. By
                default what the noise of each column asks for, see `vsacli.trajectory.fits.fit_samples`.
            name: used in reports and for the name of the result file.

        Raises:
            InputError: `fit` is no such word; or naming each array that does not fit, by index.
        """
        from vsacli.trajectory.fits import METHODS
        from vsacli.trajectory.recorded.samples import (
            SampledProfile,
            Samples,
            checked_array,
            time_problems,
            value_problems,
        )

        if fit not in (None, *METHODS):
            raise InputError.one(f"fit must be one of {', '.join(METHODS)}, not {fit!r}")
        times = checked_array("time", time, None)
        position = Samples.from_arrays(POSITION, times, q, dq, ddq, d3q, d4q)
        stiffnesses = _recorded(STIFFNESS, times, stiffness, dstiffness, ddstiffness)
        wrenches = _recorded(WRENCH, times, wrench, dwrench, ddwrench)
        records = [position, *stiffnesses, *wrenches]
        problems = [*time_problems(times), *(found for part in records for found in value_problems(part))]
        if problems:
            raise InputError(Problem("", 0, str(problem)) for problem in problems)
        profiles = {record.signal: SampledProfile.of(record, fit) for record in records}
        exerted = WrenchProfile(profiles[WRENCH], wrench_frame) if wrenches else None
        recorded = RecordedTimes(times)
        moving = profiles[POSITION]
        chosen = profiles[STIFFNESS] if stiffnesses else no_stiffness(moving.components, recorded)
        return cls(recorded, moving, chosen, wrench=exerted, name=name)

    @property
    def joints(self) -> int:
        """Number of joints."""
        return self.position.components

    @property
    def stiffened(self) -> BoolArray:
        """The joints for which a stiffness is chosen, (joints,)."""
        chosen: BoolArray = ~np.isnan(self.block(0, 1).stiffness[0])
        return chosen

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
        return self._motion(time, lambda profile: profile.samples(start, stop, time))

    def at(self, time: FloatArray) -> Motion:
        """The smooth functions at any times of the span, (samples,); given derivatives play no part."""
        return self._motion(time, lambda profile: profile.at(time))

    def _motion(self, time: FloatArray, rows: Callable[[Profile], FloatArray]) -> Motion:
        commanded = map(over_time, (*rows(self.position), *rows(self.stiffness)))
        if self.wrench is None:
            return Motion(time, *commanded)
        wrench = Wrench(*map(over_time, rows(self.wrench.profile)), frame=self.wrench.frame)
        return Motion(time, *commanded, wrench=wrench)

    @property
    def fits(self) -> tuple[dict[str, Any], ...]:
        """What is known of the splines that its steps come from, see `SampledProfile.summary`."""
        summaries = (profile.summary() for _, profile in self._profiles())
        return tuple(summary for summary in summaries if summary is not None)

    def stretched(self, factor: float) -> Trajectory:
        """Position, stiffness and wrench slower by a factor; steps at a uniform rate keep their rate."""
        return Trajectory(
            self.times.stretched(factor),
            self.position.stretched(factor),
            self.stiffness.stretched(factor),
            wrench=None if self.wrench is None else self.wrench.stretched(factor),
            name=self.name,
            sources=self.sources,
        )

    @property
    def breakpoints(self) -> FloatArray:
        """Ascending times between which all its functions are analytic; the first and last are its span."""
        times = np.sort(np.concatenate([profile.breakpoints for _, profile in self._profiles()]))
        distinct: FloatArray = times[np.append(True, np.diff(times) > 0)]  # np.unique would import numpy.ma
        return distinct

    def check_points(self, count: int) -> tuple[FloatArray, FloatArray]:
        """`count` times all over the span at which the derivatives can be checked by finite differences.

        Returns:
            Times (count,), respaced evenly within the pieces of the functions that evenly spread times fall
            into, and for each the distance to the nearest end of its piece, within which all is analytic.
        """
        ends = self.breakpoints
        spread = ends[0] + self.duration * (np.arange(count) + 0.5) / count
        piece, which, hits = np.unique(
            np.searchsorted(ends, spread, side="right") - 1, return_inverse=True, return_counts=True
        )
        rank = np.arange(count) - (np.cumsum(hits) - hits)[which]
        left, right = ends[piece][which], ends[piece + 1][which]
        time = left + (right - left) * (rank + 0.5) / hits[which]
        return time, np.minimum(time - left, right - time)


def no_stiffness(joints: int, times: Times) -> Constant:
    """The profile of a robot that has no antagonistic joint."""
    return Constant(signal=STIFFNESS, span=times.span, value=(math.nan,) * joints)


def _recorded(
    signal: Signal, times: FloatArray, values: ArrayLike | None, *derivatives: ArrayLike | None
) -> list[Samples]:
    """The samples of a signal, if there are any."""
    from vsacli.trajectory.recorded.samples import Samples

    if values is not None:
        return [Samples.from_arrays(signal, times, values, *derivatives)]
    if any(given is not None for given in derivatives):
        name = signal.names[0]
        raise InputError.one(f"derivatives of a {name} are given, but not the {name}")
    return []
