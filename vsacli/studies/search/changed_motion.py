"""Trajectories with another stiffness, with divided steps, or slower at the rate of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import STIFFNESS, Signal
from vsacli.base.texts import as_name
from vsacli.trajectory.curves import ClosedForm
from vsacli.trajectory.fits import INTERPOLATE, FitChoice
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.recorded.even_stamps import elapsed_times, even_rate
from vsacli.trajectory.recorded.hermite import HermiteSpline, belong_together
from vsacli.trajectory.recorded.samples import SampledProfile, Samples
from vsacli.trajectory.times import RecordedTimes, ResampledTimes, Times, UniformTimes
from vsacli.trajectory.trajectory import Trajectory

NOTHING: Mapping[int, FloatArray] = MappingProxyType({})
"""No change of any component."""


def with_raised_stiffness(trajectory: Trajectory, constants: Mapping[int, float]) -> Trajectory:
    """Return a trajectory with constants added to the stiffness of joints, given by index, N m/rad (N/m).

    A stiffness that is a formula stays one, and one to which nothing is added stays as it is.
    """
    stiffness = trajectory.commanded[STIFFNESS.key]
    if not any(constants.values()):
        return with_stiffness(trajectory, stiffness)
    if not isinstance(stiffness, ClosedForm):
        steps = np.zeros((3, trajectory.samples))
        steps[0] = 1.0
        return with_changed_stiffness(trajectory, {joint: by * steps for joint, by in constants.items()})
    raised = stiffness.raised([constants.get(joint, 0.0) for joint in range(trajectory.joints)])
    return with_stiffness(trajectory, raised)


def with_stiffness(trajectory: Trajectory, stiffness: Profile) -> Trajectory:
    """Return a trajectory at the same times with another profile of the stiffness."""
    return _fixed(trajectory, trajectory.times, stiffness)


def with_changed_stiffness(trajectory: Trajectory, changes: Mapping[int, FloatArray]) -> Trajectory:
    """Return a trajectory with the same steps, whose stiffness is recorded at them.

    Args:
        trajectory: the trajectory to change.
        changes: for joints by index the addition to the stiffness, its rate and its second derivative at the
            steps, (3, steps), N m/rad (N/m) per s^k.
    """
    time = trajectory.times.block(0, trajectory.samples)
    stiffness = _at_steps(STIFFNESS, trajectory.commanded[STIFFNESS.key], trajectory, changes)
    return _fixed(_with_records_at_steps(trajectory), RecordedTimes(time), stiffness)


def _with_records_at_steps(trajectory: Trajectory) -> Trajectory:
    """Return the same, but what was recorded at other times than the steps is known at the steps alone.

    All that a file records has the same times, and the stiffness has those of the steps.
    """
    resampled = {signal for signal, estimate in trajectory.estimates.items() if estimate.resampled}

    def known(signal: Signal, profile: Profile) -> Profile:
        return _at_steps(signal, profile, trajectory) if signal in resampled else profile

    return trajectory.changed(known, trajectory.times)


def _at_steps(
    signal: Signal, profile: Profile, trajectory: Trajectory, changes: Mapping[int, FloatArray] = NOTHING
) -> HermiteSpline:
    """Return a signal known at the steps with all its derivatives, and something added to some components."""
    elapsed = elapsed_times(trajectory.times.block(0, trajectory.samples))
    rows = profile.samples(0, trajectory.samples, elapsed).copy()
    for component, change in changes.items():
        rows[:, component] += change
    return HermiteSpline(signal=signal, time=elapsed, rows=rows)


def _fixed(trajectory: Trajectory, times: Times, stiffness: Profile) -> Trajectory:
    return Trajectory(
        times,
        trajectory.position,
        {**trajectory.commanded, STIFFNESS.key: stiffness},
        wrench=trajectory.wrench,
        name=as_name(f"{trajectory.name}-fixed"),
    )


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
        trajectory: the recorded one.
        factor: by which it is to be passed more slowly.
        rate: steps per second; None if there is no such rate.
    """
    if rate is None or not isinstance(trajectory.times, RecordedTimes) or not trajectory.known_between:
        return trajectory, factor
    if trajectory.estimates and not _has_derivatives(trajectory):
        times = ResampledTimes(*trajectory.times.span, rate)
        return trajectory.changed(lambda _, profile: _resampled(profile, trajectory.start), times), factor
    slower = trajectory.stretched(factor)
    stamps = ResampledTimes(*slower.times.span, rate)
    time = stamps.block(0, stamps.samples)
    elapsed = elapsed_times(time)

    def anew(signal: Signal, profile: Profile) -> Profile:
        if isinstance(profile, SampledProfile | HermiteSpline):
            return HermiteSpline(signal=signal, time=elapsed, rows=profile.at(elapsed))
        return profile

    return slower.changed(anew, RecordedTimes(time)), 1.0


def _has_derivatives(trajectory: Trajectory) -> bool:
    recorded = (profile for _, profile in trajectory.profiles() if isinstance(profile, SampledProfile))
    return any(given is not None for profile in recorded for given in profile.record.derivatives)


def _resampled(profile: Profile, start: float) -> Profile:
    """Return a record whose fit counts; what was changed at the samples is fitted through its values."""
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


PARTS = (1, 2, 4, 8, 16)
"""Parts into which steps are divided, one after the other. A reader takes samples with all derivatives for
one function if the highest one is nearly a line between samples; pieces of one step take eight parts."""


def as_one_function(trajectory: Trajectory) -> Trajectory:
    """Return a trajectory with its steps divided, if they have to be so that a file describes it.

    Where a signal comes from a fit, or is not known between its samples, steps stay as they are.
    """
    if trajectory.estimates or not trajectory.known_between:
        return trajectory
    divided = (trajectory if parts == 1 else _divided(trajectory, parts) for parts in PARTS)
    return next((each for each in divided if reads_back(each)), trajectory)


def reads_back(trajectory: Trajectory) -> bool:
    """Return whether all signals that are recorded at the steps are taken for one function by a reader."""
    return all(
        belong_together(profile.time, profile.rows)
        for _, profile in trajectory.profiles()
        if isinstance(profile, HermiteSpline)
    )


def _divided(trajectory: Trajectory, parts: int) -> Trajectory:
    """Return the same functions at more steps; formulas stay formulas."""
    steps = trajectory.times.block(0, trajectory.samples)
    shares = np.arange(parts) / parts
    time = np.append((steps[:-1, None] + np.diff(steps)[:, None] * shares).ravel(), steps[-1])
    elapsed = elapsed_times(time)

    def recorded(signal: Signal, profile: Profile) -> Profile:
        if isinstance(profile, ClosedForm):
            return profile
        return HermiteSpline(signal=signal, time=elapsed, rows=profile.at(elapsed))

    return trajectory.changed(recorded, RecordedTimes(time))
