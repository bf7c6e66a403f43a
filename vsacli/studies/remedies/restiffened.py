"""The same motion with another stiffness."""

from __future__ import annotations

from collections.abc import Mapping

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.curves import STIFFNESS
from vsacli.trajectory.fits import INTERPOLATE
from vsacli.trajectory.recorded.samples import SampledProfile, Samples
from vsacli.trajectory.times import RecordedTimes
from vsacli.trajectory.trajectory import Trajectory


def restiffened(trajectory: Trajectory, changes: Mapping[int, FloatArray]) -> Trajectory:
    """A trajectory with the same steps, whose stiffness is recorded at them.

    Args:
        trajectory: what is to be changed.
        changes: for joints by index what to add to the stiffness, its rate and its second derivative at the
            steps, (3, steps), N m/rad (N/m) per s^k.
    """
    time = trajectory.times.block(0, trajectory.samples)
    rows = trajectory.stiffness.samples(0, trajectory.samples, time).copy()
    for joint, change in changes.items():
        rows[:, joint] += change
    values, *derivatives = rows
    labels = tuple(f"column {joint}" for joint in range(len(values)))
    record = Samples(
        signal=STIFFNESS, time=time, values=values, derivatives=tuple(derivatives), labels=labels
    )
    stiffness = SampledProfile.of(record, INTERPOLATE)
    name = f"{trajectory.name}-fixed"
    return Trajectory(
        RecordedTimes(time), trajectory.position, stiffness, wrench=trajectory.wrench, name=name
    )
