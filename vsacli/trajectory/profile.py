"""Signals over time: the interface of profiles, and the profile of the wrenches with their frames."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.signals import WRENCH, Signal
from vsacli.base.wrench import WRENCH_AXES, WrenchFrame, check_frame, frames_by_tool, wrench_components

if TYPE_CHECKING:
    from vsacli.trajectory.recorded.samples import SampledProfile


class Profile(Protocol):
    """A function of time with one component per joint or axis, and its first derivatives.

    By default it is a formula: samples are evaluated like any other time, and nothing is uncertain.
    """

    @property
    @abstractmethod
    def components(self) -> int:
        """Number of components: one per joint, or six of a wrench."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about implausible values."""
        return ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the interpretation of the samples, where that is not obvious."""
        return ()

    @property
    @abstractmethod
    def breakpoints(self) -> FloatArray:
        """Ascending times between which the function is analytic; the first and last are its span."""

    @property
    def known_between(self) -> bool:
        """Whether `at` also gives the values at samples; False if these are given and known only there."""
        return True

    @abstractmethod
    def at(self, time: FloatArray) -> FloatArray:
        """Return value and derivatives at any times of the span, shape (orders, components, samples)."""

    def samples(self, _start: int, _stop: int, time: FloatArray, /) -> FloatArray:
        """Return the same at samples start..stop-1, whose times are `time`; given columns pass through."""
        return self.at(time)

    @abstractmethod
    def stretched(self, factor: float) -> Profile:
        """Return the profile slowed down by a factor, with the same first time."""

    @property
    def estimate(self) -> SampledProfile | None:
        """This profile if any value at the samples comes from a fit of recorded samples, else None."""
        return None


@dataclass(frozen=True)
class WrenchProfile:
    """The force and moment of the environment on each tool, over time.

    Attributes:
        profile: force and moment about the origin of the tool frame, `WRENCH_AXES`, N and N m; of several
            tools the six components of each in turn. Or the profile for each tool on which a wrench acts, by
            `wrench_on`.
        frame: frame along whose axes the components are, "end_effector" or "base"; for several tools that of
            each, None for a tool on which nothing acts.
    """

    profile: Profile | Mapping[Signal, Profile]
    frame: WrenchFrame = "end_effector"

    def __post_init__(self) -> None:
        for frame in frames_by_tool(self.frame):
            if frame is not None:
                check_frame(frame)
        by_tool = isinstance(self.profile, Mapping)
        expected = len(WRENCH_AXES) if by_tool else wrench_components(self.frame)
        for profile in self.profiles.values():
            if profile.components != expected:
                tool_clause = "" if by_tool or isinstance(self.frame, str) else ", of each tool"
                expected_text = f"{expected} ({', '.join(WRENCH_AXES)}{tool_clause})"
                raise InputError.one(f"the wrench has {profile.components} components, not {expected_text}")

    @property
    def profiles(self) -> Mapping[Signal, Profile]:
        """Profile by signal: of each tool on which a wrench acts, or of all tools if not given by tool."""
        return self.profile if isinstance(self.profile, Mapping) else {WRENCH: self.profile}

    def frame_of(self, signal: Signal) -> str:
        """Return the frame of one of `profiles`."""
        return frames_by_tool(self.frame)[signal.first // len(WRENCH_AXES)] or ""

    def rows(self, rows: Callable[[Profile], FloatArray]) -> FloatArray:
        """Return value and derivatives, (orders, components, samples), from those of each profile.

        They are zero on tools on which nothing acts.
        """
        rows_by_signal = {signal: rows(profile) for signal, profile in self.profiles.items()}
        if WRENCH in rows_by_signal:
            return rows_by_signal[WRENCH]
        orders, _, samples = next(iter(rows_by_signal.values())).shape
        wrench_rows = np.zeros((orders, wrench_components(self.frame), samples))
        for signal, profile_rows in rows_by_signal.items():
            wrench_rows[:, signal.columns] = profile_rows
        return wrench_rows

    def changed(self, change: Callable[[Signal, Profile], Profile]) -> WrenchProfile:
        """Return the wrenches with `change` applied to each of `profiles`."""
        if not isinstance(self.profile, Mapping):
            return replace(self, profile=change(WRENCH, self.profile))
        return replace(self, profile={each: change(each, profile) for each, profile in self.profile.items()})
