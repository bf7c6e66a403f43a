"""Signals over time: the interface of profiles, and the profile of a wrench with its frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.wrench import WRENCH_AXES, WrenchFrame, check_frame, frames_by_tool, wrench_components

if TYPE_CHECKING:
    from vsacli.trajectory.recorded.samples import SampledProfile


class Profile(Protocol):
    """A function of time with one component per joint or axis, and its first derivatives."""

    @property
    def components(self) -> int:
        """Number of components: one per joint, or six of a wrench."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about implausible values."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the interpretation of the samples, where that is not obvious."""

    @property
    def breakpoints(self) -> FloatArray:
        """Ascending times between which the function is analytic; the first and last are its span."""

    @property
    def known_between(self) -> bool:
        """Whether `at` also gives the values at samples; False if these are given and known only there."""

    def at(self, time: FloatArray) -> FloatArray:
        """Return value and derivatives at any times of the span, shape (orders, components, samples)."""

    def samples(self, start: int, stop: int, time: FloatArray, /) -> FloatArray:
        """Return the same at samples start..stop-1, whose times are `time`; given columns pass through."""

    def stretched(self, factor: float) -> Profile:
        """Return the profile slowed down by a factor, with the same first time."""

    @property
    def estimate(self) -> SampledProfile | None:
        """This profile if any value at the samples comes from a fit of recorded samples, else None."""


@dataclass(frozen=True)
class ContinuousProfile:
    """A profile evaluated at other samples than its own, by `at` throughout."""

    profile: Profile

    @property
    def components(self) -> int:
        """Number of components: one per joint, or six of a wrench."""
        return self.profile.components

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about implausible values."""
        return self.profile.warnings

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the interpretation, where that is not obvious."""
        return self.profile.notes

    @property
    def breakpoints(self) -> FloatArray:
        """Ascending times between which the function is analytic; the first and last are its span."""
        return self.profile.breakpoints

    @property
    def known_between(self) -> bool:
        """True, since samples are evaluated like any other time."""
        return True

    def at(self, time: FloatArray) -> FloatArray:
        """Return value and derivatives at any times of the span, shape (orders, components, samples)."""
        return self.profile.at(time)

    def samples(self, _start: int, _stop: int, time: FloatArray, /) -> FloatArray:
        """Return the same at samples, whose times are `time`."""
        return self.profile.at(time)

    def stretched(self, factor: float) -> ContinuousProfile:
        """Return the profile slowed down by a factor, with the same first time."""
        return ContinuousProfile(self.profile.stretched(factor))

    @property
    def estimate(self) -> SampledProfile | None:
        """The original profile if any value at its samples comes from a fit, else None."""
        return self.profile.estimate


@dataclass(frozen=True)
class WrenchProfile:
    """The force and moment of the environment on each tool, over time.

    Attributes:
        profile: force and moment about the origin of the tool frame, `WRENCH_AXES`, N and N m; of several
            tools the six components of each in turn.
        frame: frame along whose axes the components are, "end_effector" or "base"; for several tools that of
            each, None for a tool on which nothing acts.
    """

    profile: Profile
    frame: WrenchFrame = "end_effector"

    def __post_init__(self) -> None:
        for frame in frames_by_tool(self.frame):
            if frame is not None:
                check_frame(frame)
        if self.profile.components != wrench_components(self.frame):
            of_tool = f"({', '.join(WRENCH_AXES)}{'' if isinstance(self.frame, str) else ', of each tool'})"
            expected = f"{wrench_components(self.frame)} {of_tool}"
            raise InputError.one(f"the wrench has {self.profile.components} components, not {expected}")
