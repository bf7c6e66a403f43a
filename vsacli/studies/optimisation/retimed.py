"""A trajectory passed at another pace, recorded at its steps with all derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from vsacli.base.arrays import FloatArray, by_joint
from vsacli.base.signals import COMMANDED, POSITION, STIFFNESS, WRENCH, Signal
from vsacli.studies.optimisation.paced_motion import PACE_ORDERS, Speeds
from vsacli.trajectory.profile import WrenchProfile
from vsacli.trajectory.recorded.hermite import HermiteSpline
from vsacli.trajectory.times import RecordedTimes
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

NEWTON_STEPS = 6
"""Steps that find s at a time, from where a line between two of many instants leads, to rounding."""

FIRST_LOOK = 4000
"""Instants between which these lines are drawn."""


def retimed(
    trajectory: Trajectory,
    pace: BSpline[np.float64],
    stiffness: Mapping[int, BSpline[np.float64]],
    name: str,
    refined: int = 1,
) -> Trajectory:
    """The motion of a trajectory along its path at a pace dt/ds, at about its own rate.

    Args:
        trajectory: the path, whose parameter s is the time since its start.
        pace: over the path.
        stiffness: over the path, of joints by index that get another one.
        name: of the result.
        refined: times the rate.
    """
    elapsed = pace.antiderivative()
    duration = float(elapsed(trajectory.duration) - elapsed(0.0))
    rate = (trajectory.samples - 1) / trajectory.duration
    time = np.linspace(0.0, duration, refined * max(1, round(duration * rate)) + 1)
    s = path_at(time, pace, trajectory.duration)
    speeds = Speeds.of([pace(s, nu=order) for order in range(PACE_ORDERS)])
    motion = trajectory.at(trajectory.start + s)
    arrays = {each: by_joint(rows) for each, rows in motion.variables().items() if each != "time"}
    for index, spline in stiffness.items():
        for order, each in enumerate(STIFFNESS.names):
            arrays[each][index] = spline(s, nu=order)

    def recorded(signal: Signal) -> HermiteSpline:
        by_s = np.stack([arrays[each] for each in signal.names])
        return HermiteSpline(signal=signal, time=time, rows=np.stack(speeds.rates(list(by_s))))

    wrench = None if motion.wrench is None else WrenchProfile(recorded(WRENCH), motion.wrench.frame)
    commanded = {
        key: recorded(COMMANDED[key]) for key in trajectory.commanded if trajectory.chosen(key).any()
    }
    return Trajectory(RecordedTimes(time), recorded(POSITION), commanded, wrench=wrench, name=name)


def path_at(time: FloatArray, pace: BSpline[np.float64], end: float) -> FloatArray:
    """S at times since the start, (samples,), by Newton's method."""
    elapsed = pace.antiderivative()
    known = np.linspace(0.0, end, FIRST_LOOK)
    s = np.interp(time, elapsed(known) - elapsed(0.0), known)
    for _ in range(NEWTON_STEPS):
        s = np.clip(s - (elapsed(s) - elapsed(0.0) - time) / pace(s), 0.0, end)
    return s
