"""The trajectory of a robot: motion, commanded signals and wrench, at its samples and between them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, over_time
from vsacli.base.errors import InputError, Problem
from vsacli.base.signals import (
    COMMANDED,
    POSITION,
    WRENCH,
    Signal,
    commanded_names,
    orders_of_derivation,
    wrench_on,
)
from vsacli.base.variables import UNCERTAIN
from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES, Wrench, WrenchFrame
from vsacli.documents.source import Source
from vsacli.trajectory.curves import ConstantProfile
from vsacli.trajectory.profile import Profile, WrenchProfile
from vsacli.trajectory.times import Times

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from vsacli.trajectory.recorded.samples import SampledProfile


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion and commanded signals over a block of times.

    Attributes:
        time: (samples,) in s.
        q, dq, ddq, d3q, d4q: position and its four derivatives, (samples, joints), rad (m) per s^k.
        commanded: signals of `COMMANDED` and their derivatives by name, e.g. `dstiffness`, (samples, joints);
            NaN for a joint without this command.
        wrench: wrench of the environment on the tools; None without one.
    """

    time: FloatArray
    q: FloatArray
    dq: FloatArray
    ddq: FloatArray
    d3q: FloatArray
    d4q: FloatArray
    commanded: Mapping[str, FloatArray]
    wrench: Wrench | None = field(default=None, kw_only=True)

    @classmethod
    def of(cls, time: FloatArray, arrays: Mapping[str, FloatArray], wrench: Wrench | None = None) -> Motion:
        """Return the motion from arrays by the names of result variables; other arrays are ignored."""
        q, dq, ddq, d3q, d4q = (arrays[name] for name in POSITION.names)
        commanded = {name: arrays[name] for name in commanded_names() if name in arrays}
        return cls(time, q, dq, ddq, d3q, d4q, commanded, wrench=wrench)

    @property
    def of_joints(self) -> dict[str, FloatArray]:
        """Arrays of the joints by the names of result variables."""
        return {**{name: getattr(self, name) for name in POSITION.names}, **self.commanded}

    def variables(self) -> dict[str, FloatArray]:
        """Return all arrays by the names of result variables."""
        arrays = {"time": self.time, **self.of_joints}
        if self.wrench is not None:
            arrays |= {name: getattr(self.wrench, name) for name in WRENCH_NAMES}
        return arrays

    def mapped(self, time: FloatArray, function: Callable[[FloatArray, int], FloatArray]) -> Motion:
        """Return the motion at other times, with each array replaced by `function(array, order)`."""
        orders = orders_of_derivation()
        arrays = {name: function(array, orders[name]) for name, array in self.of_joints.items()}
        return Motion.of(time, arrays, self.wrench and self.wrench.mapped(function))


NARROWEST_PIECE = 1e-9
"""Share of the duration; narrower pieces arise where knots of two splines differ only by rounding."""


class Trajectory:
    """Motion and commanded signals of all joints, and the wrenches on the tools, over the same times.

    Attributes:
        times: sample times.
        position: profile of the motion. All profiles count time from the first sample: stamps since 1970 are
            rounded to 2.4e-7 s, too coarse for knots, integrators and finite differences.
        commanded: profiles of signals by their keys in `COMMANDED`, e.g. `stiffness`; NaN if not commanded.
        wrench: profile of the wrenches of the environment; None without one.
        name: name for reports and for the result file.
        sources: files that the trajectory was read from.
    """

    _is_functional = False
    """Whether samples are values of smooth functions, like those at any other time."""

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
        """Join profiles of the same joints, which go from zero to the duration.

        A signal missing from `commanded` becomes NaN for all joints; one of a device is left out.

        Raises:
            InputError: the numbers of joints or the spans differ.
        """
        self.times, self.position, self.wrench, self.name = times, position, wrench, name
        no_command = (math.nan,) * self.joints
        self.commanded = {
            key: commanded.get(key)
            or ConstantProfile(signal=signal, span=(0.0, self.duration), value=no_command)
            for key, signal in COMMANDED.items()
            if key in commanded or signal.device is None
        }
        self._source_warnings, self._source_notes = tuple(warnings), tuple(notes)
        self.sources = tuple(sources)
        self._check()

    @property
    def located_warnings(self) -> tuple[Problem, ...]:
        """Warnings about times and profiles, with the line of a value in the file if known."""
        profile_warnings = (each for _, profile in self.profiles() for each in profile.warnings)
        messages = (*self._source_warnings, *profile_warnings)
        return tuple(each if isinstance(each, Problem) else Problem("", 0, each) for each in messages)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Texts of `located_warnings`."""
        return tuple(map(str, self.located_warnings))

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the interpretation of times and profiles, where that is not obvious."""
        profile_notes = (each for _, profile in self.profiles() for each in profile.notes)
        return (*self._source_notes, *self.times.notes, *profile_notes)

    def __repr__(self) -> str:
        first, last = self.times.span
        wrench_clause = "" if self.wrench is None else ", with a wrench"
        size_text = f"{self.joints} joints, {self.samples} samples, {first:g} to {last:g} s"
        return f"Trajectory {self.name}: {size_text}{wrench_clause}"

    def _repr_html_(self) -> str:
        from html import escape  # needed only in notebooks

        return f"<p>{escape(repr(self))}</p>"

    def profiles(self) -> Iterator[tuple[Signal, Profile]]:
        """Yield each signal with its profile: position, commanded signals, wrench."""
        yield POSITION, self.position
        yield from ((COMMANDED[key], profile) for key, profile in self.commanded.items())
        if self.wrench is not None:
            yield from self.wrench.profiles.items()

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
        wrench_frame: WrenchFrame = "end_effector",
        fit: str | None = None,
        name: str = "samples",
        **commanded: ArrayLike | None,
    ) -> Trajectory:
        """Return a trajectory through samples; derivatives that are given are used unchanged.

        Missing derivatives come from splines: degree 7 (C6) for q, degree 5 (C4) for the stiffness and the
        wrench. Between the samples `at` evaluates these splines, or, if all derivatives are given and
        consistent with each other, the function through the given values and derivatives.

        Args:
            time: times, (samples,), s, strictly increasing, at least 8.
            q: position, (samples, joints), rad (m), as are its derivatives per s^k.
            stiffness: joint stiffness, (samples, joints), N m/rad (N/m), as are its derivatives per s^k.
                Joints without commanded stiffness may have NaN; None if no joint has a commanded stiffness.
            dq: first derivative of q.
            ddq: second derivative of q.
            d3q: third derivative of q.
            d4q: fourth derivative of q.
            wrench: wrench of the environment on the end effector, (samples, 6): force and moment about the
                origin of the tool frame, N and N m, as are its derivatives per s^k; None without one. Of a
                robot with several tools (samples, tools, 6), or (samples, 6 tools).
            dwrench: first derivative of its components.
            ddwrench: second derivative of its components.
            wrench_frame: frame along whose axes the components are, "end_effector" or "base"; for several
                tools a tuple with the frame of each, None for a tool on which nothing acts.
            fit: kind of spline: "interpolate" goes through the samples; "lsq" fits noisy samples by least
                squares, with knots by generalized cross-validation; "smooth" is a smoothing spline for noise
                of any color. With the last two the values at samples are also those of the spline. By default
                it is chosen by the noise of each column, see `vsacli.trajectory.fits.fit_samples`.
            name: name for reports and for the result file.
            **commanded: derivatives of the stiffness, `dstiffness` and `ddstiffness`; further signals of
                `COMMANDED` and their derivatives, (samples, joints).

        Raises:
            TypeError: a signal does not exist.
            InputError: `fit` is unknown, or arrays have wrong shapes or values; names each, with the index.
        """
        from vsacli.trajectory.recorded.arrays import profiles_of_arrays

        arrays_by_signal = {
            POSITION: (q, dq, ddq, d3q, d4q),
            **_arrays_by_signal({"stiffness": stiffness, **commanded}),
            **_wrenches_by_tool(wrench_frame, np.size(time), (wrench, dwrench, ddwrench)),
        }
        times, profiles, warnings = profiles_of_arrays(time, arrays_by_signal, fit)
        wrenches = {
            signal: profiles[signal.key]
            for signal in arrays_by_signal
            if signal.is_wrench and signal.key in profiles
        }
        wrench_profile = WrenchProfile(wrenches, wrench_frame) if wrenches else None
        return cls(
            times, profiles[POSITION.key], profiles, wrench=wrench_profile, name=name, warnings=warnings
        )

    @property
    def joints(self) -> int:
        """Number of joints."""
        return self.position.components

    def chosen(self, key: str) -> BoolArray:
        """Return the mask, (joints,), of the joints that the signal with this key commands."""
        if key not in self.commanded:
            return np.zeros(self.joints, dtype=bool)
        return np.asarray(~np.isnan(self.block(0, 1).commanded[key][0]))

    def commanding(self, signal: Signal, value: tuple[float, ...], note: str) -> Trajectory:
        """Return the trajectory with a constant as a further signal; NaN for joints it does not command."""
        commanded_trajectory = copy(self)
        constant = ConstantProfile(signal=signal, span=(0.0, self.duration), value=value)
        commanded_trajectory.commanded = {**self.commanded, signal.key: constant}
        commanded_trajectory._source_notes = (*self._source_notes, note)
        return commanded_trajectory

    @property
    def samples(self) -> int:
        """Number of samples, both ends included."""
        return self.times.samples

    @property
    def start(self) -> float:
        """Time of the first sample, s."""
        return self.times.span[0]

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, s."""
        first, last = self.times.span
        return last - first

    def block(self, start: int, stop: int) -> Motion:
        """Return the motion at samples start..stop-1; like a slice, clipped at the last sample."""
        time = self.times.block(start, stop)
        if self._is_functional:
            return self.at(time)
        return self._motion(time, lambda profile: profile.samples(start, stop, time - self.start))

    def at(self, time: ArrayLike) -> Motion:
        """Return the motion at any times of the span, (samples,) or (), from smooth functions.

        Derivatives that were given are used only if all are given and consistent with each other.
        """
        times = np.asarray(time, dtype=np.float64)
        elapsed = np.atleast_1d(times) - self.start
        return self._motion(times, lambda profile: profile.at(elapsed))

    def _motion(self, time: FloatArray, rows: Callable[[Profile], FloatArray]) -> Motion:
        """Return the motion at times, (samples,) or (), from a function that gives the rows of a profile."""
        over_samples: Callable[[FloatArray], FloatArray] = over_time if time.ndim else itemgetter((..., 0))
        commanded = {
            name: over_samples(row)
            for key, profile in self.commanded.items()
            for name, row in zip(COMMANDED[key].names, rows(profile), strict=True)
        }
        wrench = None
        if self.wrench is not None:
            wrench = Wrench(*map(over_samples, self.wrench.rows(rows)), frame=self.wrench.frame)
        q, dq, ddq, d3q, d4q = map(over_samples, rows(self.position))
        return Motion(time, q, dq, ddq, d3q, d4q, commanded, wrench=wrench)

    @property
    def fits(self) -> tuple[dict[str, Any], ...]:
        """Properties of the splines behind the samples; see `SampledProfile.summary`."""
        return tuple(estimate.summary() for estimate in self.estimates.values())

    @property
    def estimates(self) -> dict[Signal, SampledProfile]:
        """Profiles of the signals of which any value at the samples comes from a fit of recorded samples."""
        estimates = ((signal, profile.estimate) for signal, profile in self.profiles())
        return {signal: estimate for signal, estimate in estimates if estimate is not None}

    @property
    def uncertain(self) -> tuple[str, ...]:
        """Result variables that have a standard deviation; empty without fits of recorded samples.

        They are the variables that such fits estimate, and all that are computed from them.
        """
        estimated = {name for estimate in self.estimates.values() for name in estimate.estimated}
        trajectory_variables = {
            name for signal in (POSITION, *COMMANDED.values(), WRENCH) for name in signal.names
        }
        return tuple(
            name
            for name in UNCERTAIN
            if estimated and (name in estimated or name not in trajectory_variables)
        )

    def stretched(self, factor: float) -> Trajectory:
        """Return the trajectory slowed down by a factor; a uniform sample rate is kept."""
        return self.changed(lambda _, profile: profile.stretched(factor), self.times.stretched(factor))

    def changed(self, change: Callable[[Signal, Profile], Profile], times: Times) -> Trajectory:
        """Return the trajectory with `change` applied to each profile, and with other sample times.

        Warnings and notes of the recording or file are kept; those of profiles and times are their own.

        Raises:
            InputError: profiles and sample times no longer have the same span.
        """
        derived = self._derived(change, times)
        derived._check()
        return derived

    def sampled(self, times: Times) -> Trajectory:
        """Return the same functions at other sample times, from the first time on and not beyond the last."""
        derived = self._derived(lambda _, profile: profile, times)
        derived._is_functional = True
        return derived

    def from_zero(self) -> Trajectory:
        """Return the trajectory with time zero at its first sample, where times are rounded least."""
        return self._derived(lambda _, profile: profile, self.times.from_zero())

    def _derived(self, change: Callable[[Signal, Profile], Profile], times: Times) -> Trajectory:
        derived, wrench = copy(self), self.wrench
        derived.times, derived.position = times, change(POSITION, self.position)
        derived.commanded = {key: change(COMMANDED[key], each) for key, each in self.commanded.items()}
        derived.wrench = wrench and wrench.changed(change)
        return derived

    @property
    def known_between(self) -> bool:
        """Whether `at` agrees with the samples; False if derivatives are given there alone."""
        return self._is_functional or all(profile.known_between for _, profile in self.profiles())

    @property
    def breakpoints(self) -> FloatArray:
        """Ascending times between which all profiles are analytic; the first and last are the span."""
        times = np.sort(np.concatenate([profile.breakpoints for _, profile in self.profiles()]))
        return np.asarray(self.start + times[np.append(True, np.diff(times) > 0)])  # no import of numpy.ma

    def check_points(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Return `count` times over the span at which derivatives can be checked by finite differences.

        Returns:
            Times (count,), and the distance of each to the nearest end of its piece, within which all
            profiles are analytic. Each piece gets as many times as evenly spread ones fall into it, respaced
            evenly within the piece. Pieces too narrow for differences are skipped.
        """
        piece_ends = self.breakpoints
        is_wide = np.diff(piece_ends) > NARROWEST_PIECE * self.duration
        starts, stops = piece_ends[:-1][is_wide], piece_ends[1:][is_wide]
        spread_times = piece_ends[0] + self.duration * (np.arange(count) + 0.5) / count
        piece_indices = np.searchsorted(starts, spread_times, side="right") - 1
        pieces, piece_of_time, times_per_piece = np.unique(
            np.maximum(piece_indices, 0), return_inverse=True, return_counts=True
        )
        rank_in_piece = np.arange(count) - (np.cumsum(times_per_piece) - times_per_piece)[piece_of_time]
        piece_starts, piece_stops = starts[pieces][piece_of_time], stops[pieces][piece_of_time]
        time = (
            piece_starts
            + (piece_stops - piece_starts) * (rank_in_piece + 0.5) / times_per_piece[piece_of_time]
        )
        return time, np.minimum(time - piece_starts, piece_stops - time)


def _wrenches_by_tool(
    frame: WrenchFrame, samples: int, arrays: Sequence[ArrayLike | None]
) -> dict[Signal, tuple[ArrayLike | None, ...]]:
    """Return the arrays of the wrench on each tool that has a frame, from those of all tools.

    Raises:
        InputError: an array has a wrong shape, or a wrench acts on a tool without a frame.
    """
    if isinstance(frame, str):
        return {WRENCH: tuple(arrays)}
    shape = (samples, len(frame), len(WRENCH_AXES))
    arrays_by_name: dict[str, FloatArray | None] = dict.fromkeys(WRENCH.names)
    for name, array in zip(WRENCH.names, arrays, strict=True):
        if array is not None:
            wrench_array = np.asarray(array, dtype=np.float64)
            if wrench_array.shape not in (shape, (samples, shape[1] * shape[2])):
                raise InputError.one(f"{name} has the shape {wrench_array.shape}, expected {shape}")
            arrays_by_name[name] = wrench_array = wrench_array.reshape(shape)
            for tool, tool_frame in enumerate(frame):
                if tool_frame is None and wrench_array[:, tool].any():
                    raise InputError.one(f"a {name} is given for tool {tool}, which has no frame")
    return {
        wrench_on(f"tool_{tool}", tool): tuple(
            None if rows is None else rows[:, tool] for rows in arrays_by_name.values()
        )
        for tool, tool_frame in enumerate(frame)
        if tool_frame is not None
    }


def _arrays_by_signal(
    arrays_by_name: Mapping[str, ArrayLike | None],
) -> dict[Signal, tuple[ArrayLike | None, ...]]:
    """Return commanded signals with their derivatives, from arrays by name.

    Raises:
        TypeError: a signal does not exist.
    """
    unknown_names = arrays_by_name.keys() - set(commanded_names())
    if unknown_names:
        raise TypeError(f"no signal is called {', '.join(sorted(unknown_names))}")
    return {signal: tuple(map(arrays_by_name.get, signal.names)) for signal in COMMANDED.values()}
