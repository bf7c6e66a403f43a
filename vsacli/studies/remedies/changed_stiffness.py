"""A trajectory with another stiffness."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import COMMANDED, POSITION, STIFFNESS, WRENCH, Signal
from vsacli.base.texts import as_name
from vsacli.trajectory.curves import ClosedForm
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.recorded.even_stamps import elapsed_times
from vsacli.trajectory.recorded.hermite import HermiteSpline
from vsacli.trajectory.times import RecordedTimes, Times
from vsacli.trajectory.trajectory import Trajectory

NOTHING: Mapping[int, FloatArray] = MappingProxyType({})
"""No change of any component."""


def with_raised_stiffness(trajectory: Trajectory, constants: Mapping[int, float]) -> Trajectory:
    """A trajectory with constants added to the stiffness of joints, given by index, N m/rad (N/m).

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
    """A trajectory at the same times with another profile of the stiffness."""
    return _fixed(trajectory, trajectory.times, stiffness)


def with_changed_stiffness(trajectory: Trajectory, changes: Mapping[int, FloatArray]) -> Trajectory:
    """A trajectory with the same steps, whose stiffness is recorded at them.

    Args:
        trajectory: what is to be changed.
        changes: for joints by index what to add to the stiffness, its rate and its second derivative at the
            steps, (3, steps), N m/rad (N/m) per s^k.
    """
    time = trajectory.times.block(0, trajectory.samples)
    stiffness = _at_steps(STIFFNESS, trajectory.commanded[STIFFNESS.key], trajectory, changes)
    return _fixed(_with_records_at_steps(trajectory), RecordedTimes(time), stiffness)


def _with_records_at_steps(trajectory: Trajectory) -> Trajectory:
    """The same, but what was recorded at other times than the steps is known at the steps alone.

    All that a file records has the same times, and the stiffness has those of the steps.
    """
    resampled = {signal for signal, estimate in trajectory.estimates.items() if estimate.resampled}

    def known(signal: Signal, profile: Profile) -> Profile:
        return _at_steps(signal, profile, trajectory) if signal in resampled else profile

    wrench = trajectory.wrench
    return Trajectory(
        trajectory.times,
        known(POSITION, trajectory.position),
        {key: known(COMMANDED[key], profile) for key, profile in trajectory.commanded.items()},
        wrench=wrench and replace(wrench, profile=known(WRENCH, wrench.profile)),
        name=trajectory.name,
    )


def _at_steps(
    signal: Signal, profile: Profile, trajectory: Trajectory, changes: Mapping[int, FloatArray] = NOTHING
) -> HermiteSpline:
    """A signal known at the steps with all its derivatives, and something added to some components."""
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
