"""The rate of a recording that becomes slower: a controller has one, however long the motion lasts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from vsacli.base.signals import COMMANDED, POSITION, WRENCH, Signal
from vsacli.trajectory.fits import INTERPOLATE, FitChoice
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.recorded.even_stamps import elapsed_times, even_rate
from vsacli.trajectory.recorded.hermite import HermiteSpline
from vsacli.trajectory.recorded.samples import SampledProfile, Samples
from vsacli.trajectory.times import RecordedTimes, ResampledTimes, Times, UniformTimes
from vsacli.trajectory.trajectory import Trajectory


def rate_of(trajectory: Trajectory) -> float | None:
    """Return the steps per second, also of a recording whose stamps are even; None if they are not."""
    times = trajectory.times
    if isinstance(times, UniformTimes | ResampledTimes):
        return times.rate
    return even_rate(times.block(0, trajectory.samples))


def with_kept_rate(trajectory: Trajectory, factor: float, rate: float | None) -> tuple[Trajectory, float]:
    """Return a recording that becomes slower with steps at a rate, and by which factor it is still slower.

    A record without derivatives is kept, and resampled as by `rate` in a file. One with derivatives, which
    `rate` would leave out, is recorded anew at the steps. Declared motions keep their rate by themselves, and
    what is known at its samples alone has no other steps; both are returned as they are.

    Args:
        trajectory: what is recorded.
        factor: by which it is to be passed more slowly.
        rate: steps per second; None if there is no such rate.
    """
    if rate is None or not isinstance(trajectory.times, RecordedTimes) or not trajectory.known_between:
        return trajectory, factor
    if trajectory.estimates and not _has_derivatives(trajectory):
        times = ResampledTimes(*trajectory.times.span, rate)
        return _with(trajectory, times, lambda _, profile: _resampled(profile, trajectory.start)), factor
    slower = trajectory.stretched(factor)
    stamps = ResampledTimes(*slower.times.span, rate)
    time = stamps.block(0, stamps.samples)
    elapsed = elapsed_times(time)

    def anew(signal: Signal, profile: Profile) -> Profile:
        if isinstance(profile, SampledProfile | HermiteSpline):
            return HermiteSpline(signal=signal, time=elapsed, rows=profile.at(elapsed))
        return profile

    return _with(slower, RecordedTimes(time), anew), 1.0


def _has_derivatives(trajectory: Trajectory) -> bool:
    wrench = trajectory.wrench and trajectory.wrench.profile
    recorded = (
        profile
        for profile in (trajectory.position, *trajectory.commanded.values(), wrench)
        if isinstance(profile, SampledProfile)
    )
    return any(given is not None for profile in recorded for given in profile.record.derivatives)


def _resampled(profile: Profile, start: float) -> Profile:
    """A record whose fit counts; what was changed at the samples is fitted through its values."""
    if isinstance(profile, HermiteSpline):
        samples = Samples(
            signal=profile.signal,
            time=profile.time,
            values=profile.rows[0],
            derivatives=(None,) * (profile.signal.orders - 1),
            labels=tuple(map(str, range(profile.components))),
            start=start,
        )
        return SampledProfile.of(samples, FitChoice(INTERPOLATE), resampled=True)
    return replace(profile, resampled=True) if isinstance(profile, SampledProfile) else profile


def _with(trajectory: Trajectory, times: Times, changed: Callable[[Signal, Profile], Profile]) -> Trajectory:
    wrench = trajectory.wrench
    return Trajectory(
        times,
        changed(POSITION, trajectory.position),
        {key: changed(COMMANDED[key], profile) for key, profile in trajectory.commanded.items()},
        wrench=wrench and replace(wrench, profile=changed(WRENCH, wrench.profile)),
        name=trajectory.name,
        sources=trajectory.sources,
    )
