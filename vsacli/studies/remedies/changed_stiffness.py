"""A trajectory with another stiffness."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import STIFFNESS
from vsacli.base.texts import as_name
from vsacli.trajectory.curves import ClosedForm
from vsacli.trajectory.fits import INTERPOLATE
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.recorded.samples import SampledProfile, Samples
from vsacli.trajectory.times import RecordedTimes, Times
from vsacli.trajectory.trajectory import Trajectory


def with_raised_stiffness(trajectory: Trajectory, constants: Mapping[int, float]) -> Trajectory:
    """A trajectory with constants added to the stiffness of joints, given by index, N m/rad (N/m).

    A stiffness that is a formula stays one.
    """
    stiffness = trajectory.commanded[STIFFNESS.key]
    if not isinstance(stiffness, ClosedForm):
        steps = np.zeros((3, trajectory.samples))
        steps[0] = 1.0
        return with_changed_stiffness(trajectory, {joint: by * steps for joint, by in constants.items()})
    raised = stiffness.raised([constants.get(joint, 0.0) for joint in range(trajectory.joints)])
    return _fixed(trajectory, trajectory.times, raised)


def with_changed_stiffness(trajectory: Trajectory, changes: Mapping[int, FloatArray]) -> Trajectory:
    """A trajectory with the same steps, whose stiffness is recorded at them.

    Args:
        trajectory: what is to be changed.
        changes: for joints by index what to add to the stiffness, its rate and its second derivative at the
            steps, (3, steps), N m/rad (N/m) per s^k.
    """
    time = trajectory.times.block(0, trajectory.samples)
    stiffness = trajectory.commanded[STIFFNESS.key]
    rows = stiffness.samples(0, trajectory.samples, time - trajectory.start).copy()
    for joint, change in changes.items():
        rows[:, joint] += change
    values, *derivatives = rows
    labels = tuple(f"column {joint}" for joint in range(len(values)))
    samples = Samples.recorded(STIFFNESS, time, values, tuple(derivatives), labels)
    return _fixed(trajectory, RecordedTimes(time), SampledProfile.of(samples, INTERPOLATE))


def _fixed(trajectory: Trajectory, times: Times, stiffness: Profile) -> Trajectory:
    return Trajectory(
        times,
        trajectory.position,
        {**trajectory.commanded, STIFFNESS.key: stiffness},
        wrench=trajectory.wrench,
        name=as_name(f"{trajectory.name}-fixed"),
    )
