"""Trajectories with another stiffness, more finely sampled, or slowed down at the rate of a recording."""

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
from vsacli.trajectory.recorded.hermite import HermiteSpline, derivatives_are_consistent
from vsacli.trajectory.recorded.samples import SampledProfile, SignalSamples, elapsed_times, even_rate
from vsacli.trajectory.times import RecordedTimes, ResampledTimes, Times, UniformTimes
from vsacli.trajectory.trajectory import Trajectory

NOTHING: Mapping[int, FloatArray] = MappingProxyType({})
"""Changes of no component."""


def with_raised_stiffness(trajectory: Trajectory, constants: Mapping[int, float]) -> Trajectory:
    """Return a trajectory with constants added to the stiffness of joints, N m/rad (N/m) by joint index.

    A stiffness in closed form remains in closed form; if all constants are zero, it remains unchanged.
    """
    stiffness = trajectory.commanded[STIFFNESS.key]
    if not any(constants.values()):
        return with_stiffness(trajectory, stiffness)
    if not isinstance(stiffness, ClosedForm):
        unit_rows = np.zeros((3, trajectory.samples))
        unit_rows[0] = 1.0
        return with_changed_stiffness(
            trajectory, {joint: constant * unit_rows for joint, constant in constants.items()}
        )
    joint_constants = [constants.get(joint, 0.0) for joint in range(trajectory.joints)]
    return with_stiffness(trajectory, stiffness.rescaled([1.0] * trajectory.joints, joint_constants))


def with_scaled_stiffness(trajectory: Trajectory, factors: Mapping[int, float]) -> Trajectory:
    """Return a trajectory with the stiffness of joints multiplied by factors, by joint index.

    A stiffness in closed form remains in closed form.
    """
    stiffness = trajectory.commanded[STIFFNESS.key]
    if isinstance(stiffness, ClosedForm):
        joint_factors = [factors.get(joint, 1.0) for joint in range(trajectory.joints)]
        return with_stiffness(trajectory, stiffness.rescaled(joint_factors, [0.0] * trajectory.joints))
    elapsed = elapsed_times(trajectory.times.block(0, trajectory.samples))
    rows = stiffness.samples(0, trajectory.samples, elapsed)
    changes = {joint: (factor - 1) * rows[:, joint] for joint, factor in factors.items()}
    return with_changed_stiffness(trajectory, changes)


def with_stiffness(trajectory: Trajectory, stiffness: Profile) -> Trajectory:
    """Return a trajectory at the same times with another profile of the stiffness."""
    return _with_profile(trajectory, trajectory.times, stiffness)


def with_changed_stiffness(trajectory: Trajectory, changes: Mapping[int, FloatArray]) -> Trajectory:
    """Return a trajectory at the same times, with its stiffness given as values at the samples.

    Args:
        trajectory: trajectory to change.
        changes: addition to the stiffness with its first two derivatives at the samples, (3, samples),
            N m/rad (N/m) per s^k, by joint index.
    """
    time = trajectory.times.block(0, trajectory.samples)
    stiffness = _spline_through_samples(STIFFNESS, trajectory.commanded[STIFFNESS.key], trajectory, changes)
    return _with_profile(_with_recordings_at_samples(trajectory), RecordedTimes(time), stiffness)


def _with_recordings_at_samples(trajectory: Trajectory) -> Trajectory:
    """Return the trajectory with each resampled recording replaced by its values at the samples."""
    # all recorded signals of a file have the same times, and the stiffness has those of the samples
    resampled = {signal for signal, estimate in trajectory.estimates.items() if estimate.resampled}

    def known(signal: Signal, profile: Profile) -> Profile:
        return _spline_through_samples(signal, profile, trajectory) if signal in resampled else profile

    return trajectory.changed(known, trajectory.times)


def _spline_through_samples(
    signal: Signal, profile: Profile, trajectory: Trajectory, changes: Mapping[int, FloatArray] = NOTHING
) -> HermiteSpline:
    """Return a signal given by values and derivatives at the samples, with `changes` added by component."""
    elapsed = elapsed_times(trajectory.times.block(0, trajectory.samples))
    rows = profile.samples(0, trajectory.samples, elapsed).copy()
    for component, change in changes.items():
        rows[:, component] += change
    return HermiteSpline(signal=signal, time=elapsed, rows=rows)


def _with_profile(trajectory: Trajectory, times: Times, stiffness: Profile) -> Trajectory:
    fixed = trajectory.changed(lambda signal, profile: stiffness if signal is STIFFNESS else profile, times)
    fixed.name, fixed.sources = as_name(f"{trajectory.name}-fixed"), ()
    return fixed


def rate_of(trajectory: Trajectory) -> float | None:
    """Return the sample rate in Hz, also of a recording with even time stamps; None if they are uneven."""
    times = trajectory.times
    if isinstance(times, UniformTimes | ResampledTimes):
        return times.rate
    return even_rate(times.block(0, trajectory.samples))


def with_kept_rate(trajectory: Trajectory, factor: float, rate: float | None) -> tuple[Trajectory, float]:
    """Return a recording resampled for a slow-down, and the factor by which it remains to be slowed down.

    A recording without derivatives is kept and resampled, as with `rate` in a file. A recording with
    derivatives, which `rate` would drop, is replaced by values and derivatives at the new samples. Motions in
    closed form already have the rate, and signals known only at their samples cannot be resampled; both are
    returned unchanged.

    Args:
        trajectory: recorded trajectory.
        factor: factor of the slow-down.
        rate: sample rate, Hz; None if the recording has no uniform rate.
    """
    if rate is None or not isinstance(trajectory.times, RecordedTimes) or not trajectory.known_between:
        return trajectory, factor
    if trajectory.estimates and not _has_derivatives(trajectory):
        times = ResampledTimes(*trajectory.times.span, rate)
        return trajectory.changed(lambda _, profile: _resampled(profile, trajectory.start), times), factor
    slowed_trajectory = trajectory.stretched(factor)
    sample_times = ResampledTimes(*slowed_trajectory.times.span, rate)
    time = sample_times.block(0, sample_times.samples)
    elapsed = elapsed_times(time)

    def anew(signal: Signal, profile: Profile) -> Profile:
        if isinstance(profile, SampledProfile | HermiteSpline):
            return HermiteSpline(signal=signal, time=elapsed, rows=profile.at(elapsed))
        return profile

    return slowed_trajectory.changed(anew, RecordedTimes(time)), 1.0


def _has_derivatives(trajectory: Trajectory) -> bool:
    recorded_profiles = (
        profile for _, profile in trajectory.profiles() if isinstance(profile, SampledProfile)
    )
    return any(given is not None for profile in recorded_profiles for given in profile.record.derivatives)


def _resampled(profile: Profile, start: float) -> Profile:
    """Return a profile that is resampled from a fit; values at samples are interpolated by a new fit."""
    if isinstance(profile, HermiteSpline):
        samples = SignalSamples(
            signal=profile.signal,
            time=profile.time,
            values=profile.rows[0],
            derivatives=(None,) * (profile.signal.orders - 1),
            labels=tuple(map(str, range(profile.components))),
            start=start,
        )
        return SampledProfile.of(samples, FitChoice(INTERPOLATE), resampled=True)
    return replace(profile, resampled=True) if isinstance(profile, SampledProfile) else profile


SUBDIVISIONS = (1, 2, 4, 8, 16)
"""Subdivisions of the sampling intervals, tried in this order. A reader takes samples with all derivatives
for one function if the highest derivative is nearly linear between them; splines with a piece per interval
require eight."""


def as_one_function(trajectory: Trajectory) -> Trajectory:
    """Return a trajectory with subdivided sampling intervals, if a file describes it only so.

    A trajectory with a fitted signal, or one that is known only at its samples, is returned unchanged.
    """
    if trajectory.estimates or not trajectory.known_between:
        return trajectory
    refined_motions = (
        trajectory if parts == 1 else _refined_motion(trajectory, parts) for parts in SUBDIVISIONS
    )
    return next((each for each in refined_motions if reads_back(each)), trajectory)


def reads_back(trajectory: Trajectory) -> bool:
    """Return whether a reader takes each signal given at the samples for one function between them."""
    return all(
        derivatives_are_consistent(profile.time, profile.rows)
        for _, profile in trajectory.profiles()
        if isinstance(profile, HermiteSpline)
    )


def _refined_motion(trajectory: Trajectory, parts: int) -> Trajectory:
    """Return the same functions sampled more finely; closed forms remain closed forms."""
    times = trajectory.times.block(0, trajectory.samples)
    shares = np.arange(parts) / parts
    time = np.append((times[:-1, None] + np.diff(times)[:, None] * shares).ravel(), times[-1])
    elapsed = elapsed_times(time)

    def recorded(signal: Signal, profile: Profile) -> Profile:
        if isinstance(profile, ClosedForm):
            return profile
        return HermiteSpline(signal=signal, time=elapsed, rows=profile.at(elapsed))

    return trajectory.changed(recorded, RecordedTimes(time))
