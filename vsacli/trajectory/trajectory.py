"""The trajectory a robot is asked to execute: motion, commanded signals and wrench at any of its steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, over_time
from vsacli.base.errors import InputError, Problem
from vsacli.base.signals import COMMANDED, POSITION, WRENCH, Signal, commanded_names
from vsacli.base.variables import UNCERTAIN
from vsacli.base.wrench import Wrench
from vsacli.documents.source import Source
from vsacli.trajectory.curves import Constant
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.profile import Continued, Profile, WrenchProfile
from vsacli.trajectory.times import Times

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from vsacli.trajectory.recorded.samples import SampledProfile

NARROWEST_PIECE = 1e-9
"""Share of the duration; pieces below arise where knots of two splines coincide but for rounding."""


class Trajectory:
    """Motion and commanded signals of all joints, and the wrench at the end effector, over the same times.

    Attributes:
        times: the steps.
        position: the motion at them and between them. All profiles count from the first step: stamps since
            1970 are rounded to 2.4e-7 s, too coarse for knots, integrators and differences.
        commanded: signals of `COMMANDED` by their keys, e.g. `stiffness`; NaN for a joint for which none is
            chosen.
        wrench: of the environment; None without one.
        name: used in reports and for the name of the result file.
        located_warnings: doubts about times and profiles; those on a number of the file with
            its line.
        warnings: the same as texts.
        notes: how they were understood, where that is not obvious.
        sources: the files it was read from.
    """

    def __init__(
        self,
        times: Times,
        position: Profile,
        commanded: Mapping[str, Profile],
        *,
        wrench: WrenchProfile | None = None,
        name: str,
        warnings: Iterable[str | Problem] = (),
        notes: Iterable[str] = (),
        sources: Iterable[Source] = (),
    ) -> None:
        """Join profiles that have the same joints, and go from zero to the duration.

        A signal that is not among `commanded` is chosen for no joint; that of a device is left out.

        Raises:
            InputError: they have not.
        """
        self.times, self.position, self.wrench, self.name = times, position, wrench, name
        self.commanded = {
            key: commanded[key] if key in commanded else self._nothing(signal)
            for key, signal in COMMANDED.items()
            if key in commanded or signal.device is None
        }
        profiles = [profile for _, profile in self.profiles()]
        messages = (*warnings, *(each for profile in profiles for each in profile.warnings))
        self.located_warnings = tuple(
            each if isinstance(each, Problem) else Problem("", 0, each) for each in messages
        )
        self.warnings = tuple(map(str, self.located_warnings))
        self.notes = (*notes, *times.notes, *(each for profile in profiles for each in profile.notes))
        self.sources = tuple(sources)
        self._check()

    def __repr__(self) -> str:
        first, last = self.times.span
        pushed = "" if self.wrench is None else ", with a wrench"
        size = f"{self.joints} joints, {self.samples} samples, {first:g} to {last:g} s"
        return f"Trajectory {self.name}: {size}{pushed}"

    def _repr_html_(self) -> str:
        from html import escape  # for notebooks alone

        return f"<p>{escape(repr(self))}</p>"

    def profiles(self) -> Iterator[tuple[Signal, Profile]]:
        """Yield each signal with its profile: position, commanded signals, wrench."""
        yield POSITION, self.position
        yield from ((COMMANDED[key], profile) for key, profile in self.commanded.items())
        if self.wrench is not None:
            yield WRENCH, self.wrench.profile

    def _check(self) -> None:
        for key, profile in self.commanded.items():
            if self.joints != profile.components:
                raise InputError.one(f"the position has {self.joints} joints, the {key} {profile.components}")
        rounding = np.spacing(max(map(abs, self.times.span)))
        for signal, profile in self.profiles():
            start, end = profile.breakpoints[[0, -1]]
            if start != 0 or abs(end - self.duration) > 2 * rounding:
                raise InputError.one(
                    f"the {signal.key} spans {start:g} to {end:g} s, the steps 0 to {self.duration:g} s"
                )

    def _nothing(self, signal: Signal) -> Constant:
        """Return the profile of a signal that is chosen for no joint."""
        return Constant(signal=signal, span=(0.0, self.duration), value=(math.nan,) * self.joints)

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
        wrench: ArrayLike | None = None,
        dwrench: ArrayLike | None = None,
        ddwrench: ArrayLike | None = None,
        wrench_frame: str = "end_effector",
        fit: str | None = None,
        name: str = "samples",
        **commanded: ArrayLike | None,
    ) -> Trajectory:
        """Return a trajectory through samples, with given derivatives as they are.

        Those that are not come from splines: degree 7 (C6) for q, degree 5 (C4) for the stiffness and the
        wrench. Between the samples `at` evaluates these splines; where all derivatives are given and follow
        from one another, the function through all that is given.

        Args:
            time: (samples,) in s, strictly increasing, at least 8.
            q: position, (samples, joints), rad (m), as are its derivatives per s^k.
            stiffness: joint stiffness, (samples, joints), N m/rad (N/m), as are its derivatives per s^k. Only
                that of joints that take one counts; others may have NaN, and None will do if there are none.
            dq: first derivative of q.
            ddq: second derivative of q.
            d3q: third derivative of q.
            d4q: fourth derivative of q.
            wrench: of the environment on the end effector, (samples, 6): force and moment about the
                origin of the tool frame, N and N m, as are its derivatives per s^k; None if nothing.
            dwrench: first derivative of its components.
            ddwrench: second derivative of its components.
            wrench_frame: along whose axes the components are, "end_effector" or "base".
            fit: the splines, "interpolate": through the samples, or "lsq": near noisy ones by least squares,
                with knots by generalised cross-validation, or "smooth": a smoothing spline for noise of any
                colour; with both the values are those of the spline too. By default what the noise of each
                column asks for, see `vsacli.trajectory.fits.fit_samples`.
            name: used in reports and for the name of the result file.
            **commanded: derivatives of the stiffness, `dstiffness` and `ddstiffness`; further signals of
                `COMMANDED` and their derivatives, as above.

        Raises:
            TypeError: there is no such signal.
            InputError: `fit` is no such word; or naming each array that does not fit, by index.
        """
        from vsacli.trajectory.recorded.arrays import profiles_of_arrays

        given = {
            POSITION: (q, dq, ddq, d3q, d4q),
            **_by_signal({"stiffness": stiffness, **commanded}),
            WRENCH: (wrench, dwrench, ddwrench),
        }
        times, profiles, warnings = profiles_of_arrays(time, given, fit)
        exerted = WrenchProfile(profiles[WRENCH.key], wrench_frame) if WRENCH.key in profiles else None
        return cls(times, profiles[POSITION.key], profiles, wrench=exerted, name=name, warnings=warnings)

    @property
    def joints(self) -> int:
        """Number of joints."""
        return self.position.components

    def chosen(self, key: str) -> BoolArray:
        """Return the joints for which a signal is chosen, by its key; (joints,)."""
        if key not in self.commanded:
            return np.zeros(self.joints, dtype=bool)
        chosen: BoolArray = ~np.isnan(self.block(0, 1).commanded[key][0])
        return chosen

    def commanding(self, signal: Signal, value: tuple[float, ...], note: str) -> Trajectory:
        """Return the same with a constant as a further signal, NaN for joints that do not take it."""
        same = copy(self)
        constant = Constant(signal=signal, span=(0.0, self.duration), value=value)
        same.commanded = {**self.commanded, signal.key: constant}
        same.notes = (*self.notes, note)
        return same

    @property
    def samples(self) -> int:
        """Number of steps, both ends included."""
        return self.times.samples

    @property
    def start(self) -> float:
        """Time of the first step, s."""
        return self.times.span[0]

    @property
    def duration(self) -> float:
        """Time from the first step to the last, s."""
        first, last = self.times.span
        return last - first

    def block(self, start: int, stop: int) -> Motion:
        """Return the steps start..stop-1; like a slice, it ends where the steps end."""
        time = self.times.block(start, stop)
        return self._motion(time, lambda profile: profile.samples(start, stop, time - self.start))

    def at(self, time: ArrayLike) -> Motion:
        """Return the smooth functions at any times of the span, (samples,) or ().

        Given derivatives count where all are given and follow from one another.
        """
        times = np.asarray(time, dtype=np.float64)
        elapsed = np.atleast_1d(times) - self.start
        motion = self._motion(np.atleast_1d(times), lambda profile: profile.at(elapsed))
        return motion if times.ndim else motion.mapped(times, lambda rows, _: rows[0])

    def _motion(self, time: FloatArray, rows: Callable[[Profile], FloatArray]) -> Motion:
        signals = {POSITION: self.position, **{COMMANDED[key]: each for key, each in self.commanded.items()}}
        arrays = {
            name: over_time(row)
            for signal, profile in signals.items()
            for name, row in zip(signal.names, rows(profile), strict=True)
        }
        wrench = None
        if self.wrench is not None:
            wrench = Wrench(*map(over_time, rows(self.wrench.profile)), frame=self.wrench.frame)
        return Motion.of(time, arrays, wrench)

    @property
    def fits(self) -> tuple[dict[str, Any], ...]:
        """Properties of the splines behind the samples; see `SampledProfile.summary`."""
        return tuple(estimate.summary() for estimate in self.estimates.values())

    @property
    def estimates(self) -> dict[Signal, SampledProfile]:
        """The signals of which any number at the steps comes from a fit of recorded samples."""
        found = ((signal, profile.estimate) for signal, profile in self.profiles())
        return {signal: estimate for signal, estimate in found if estimate is not None}

    @property
    def uncertain(self) -> tuple[str, ...]:
        """The variables of a run along it that have a standard deviation.

        Those that come from fits of recorded samples, and all that is computed, if there are any.
        """
        estimated = {name for estimate in self.estimates.values() for name in estimate.estimated}
        given = {name for signal in (POSITION, *COMMANDED.values(), WRENCH) for name in signal.names}
        return tuple(name for name in UNCERTAIN if estimated and (name in estimated or name not in given))

    def stretched(self, factor: float) -> Trajectory:
        """Return all profiles slower by a factor; steps at a uniform rate keep their rate."""
        return self.changed(lambda _, profile: profile.stretched(factor), self.times.stretched(factor))

    def changed(self, change: Callable[[Signal, Profile], Profile], times: Times) -> Trajectory:
        """Return the trajectory with each profile changed, and with other steps.

        Raises:
            InputError: profiles and steps no longer span the same time.
        """
        wrench = self.wrench
        return Trajectory(
            times,
            change(POSITION, self.position),
            {key: change(COMMANDED[key], profile) for key, profile in self.commanded.items()},
            wrench=wrench and replace(wrench, profile=change(WRENCH, wrench.profile)),
            name=self.name,
            sources=self.sources,
        )

    def sampled(self, times: Times) -> Trajectory:
        """Return the same functions at other steps, from its first time on and not beyond its last."""
        same = copy(self)
        same.times = times
        same.position = Continued(self.position)
        same.commanded = {key: Continued(profile) for key, profile in self.commanded.items()}
        same.wrench = self.wrench and replace(self.wrench, profile=Continued(self.wrench.profile))
        return same

    def from_zero(self) -> Trajectory:
        """Return the same from time zero on, for what needs times between the steps as exact as can be."""
        same = copy(self)
        same.times = self.times.from_zero()
        return same

    @property
    def known_between(self) -> bool:
        """Whether `at` continues the steps; it does not where derivatives are given at the samples."""
        return all(profile.known_between for _, profile in self.profiles())

    @property
    def breakpoints(self) -> FloatArray:
        """Ascending times between which all its functions are analytic; the first and last are its span."""
        times = np.sort(np.concatenate([profile.breakpoints for _, profile in self.profiles()]))
        distinct: FloatArray = times[np.append(True, np.diff(times) > 0)]  # np.unique would import numpy.ma
        return self.start + distinct

    def check_points(self, count: int) -> tuple[FloatArray, FloatArray]:
        """`count` times all over the span at which the derivatives can be checked by finite differences.

        Returns:
            Times (count,), respaced evenly within the pieces of the functions that evenly spread times fall
            into, and for each the distance to the nearest end of its piece, within which all is analytic.
            Pieces too narrow for differences are passed over.
        """
        ends = self.breakpoints
        wide = np.diff(ends) > NARROWEST_PIECE * self.duration
        starts, stops = ends[:-1][wide], ends[1:][wide]
        spread = ends[0] + self.duration * (np.arange(count) + 0.5) / count
        after = np.searchsorted(starts, spread, side="right") - 1
        piece, which, hits = np.unique(np.maximum(after, 0), return_inverse=True, return_counts=True)
        rank = np.arange(count) - (np.cumsum(hits) - hits)[which]
        left, right = starts[piece][which], stops[piece][which]
        time = left + (right - left) * (rank + 0.5) / hits[which]
        return time, np.minimum(time - left, right - time)


def _by_signal(
    of_joints: Mapping[str, ArrayLike | None],
) -> dict[Signal, tuple[ArrayLike | None, ...]]:
    """Commanded signals with their derivatives, from arrays by name.

    Raises:
        TypeError: there is no such signal.
    """
    unknown = of_joints.keys() - set(commanded_names())
    if unknown:
        raise TypeError(f"no signal is called {', '.join(sorted(unknown))}")
    return {signal: tuple(map(of_joints.get, signal.names)) for signal in COMMANDED.values()}
