"""Dampers of the joints along a trajectory: commanded, or at their minimum damping."""

from __future__ import annotations

import math

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.signals import DAMPING
from vsacli.base.units import time_text
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

SEEN = 1000
"""Times at which the damping is evaluated, in addition to all breakpoints and local minima."""

NEWTON_STEPS = 4
"""Newton steps from a sample, a thousandth of the motion away at most, to a local minimum."""

VANISHING = 1e-12
"""Share of the largest damping below which a minimum counts as zero: rounding."""


def set_uncommanded_dampers(trajectory: Trajectory, robot: Robot) -> Trajectory:
    """Return the trajectory with uncommanded dampers at their minimum, and a note on them.

    Raises:
        InputError: the damping parallel to the springs of a joint falls to zero, or below, somewhere but not
            everywhere.
    """
    if DAMPING.key not in trajectory.commanded and any(joint.damper for joint in robot.joints):
        trajectory = _with_least_damping(trajectory, robot)
    inside = [index for index, joint in enumerate(robot.joints) if joint.damper_at("transmission")]
    if inside:
        time = np.union1d(np.linspace(*trajectory.times.span, SEEN), trajectory.breakpoints)
        for index in inside:
            with_dips = np.union1d(time, _damping_minima(trajectory, time, index))
            _check_damping(
                robot.joints[index], with_dips, _commanded_damping(trajectory, with_dips, index)[0]
            )
    return trajectory


def _with_least_damping(trajectory: Trajectory, robot: Robot) -> Trajectory:
    dampers = [joint.damper for joint in robot.joints]
    least = tuple(math.nan if damper is None else damper.range[0] for damper in dampers)
    standing = ", ".join(
        f"{joint.name} at {value:g} {DAMPING.quantities[0].unit(joint.type)}"
        for joint, value in zip(robot.joints, least, strict=True)
        if joint.damper is not None
    )
    note = f"no {DAMPING.key} is commanded, so dampers stand at the least of their ranges: {standing}"
    return trajectory.commanding(DAMPING, least, note)


def _commanded_damping(trajectory: Trajectory, time: FloatArray, joint: int) -> list[FloatArray]:
    commanded = trajectory.at(time).commanded
    return [commanded[name][:, joint] for name in DAMPING.names]


def _damping_minima(trajectory: Trajectory, time: FloatArray, joint: int) -> FloatArray:
    """Return the times of local minima of the damping, by Newton's method on its rate."""
    before = np.flatnonzero(np.diff(np.sign(_commanded_damping(trajectory, time, joint)[1])) > 0)
    dips = time[before]
    for _ in range(NEWTON_STEPS):
        _, rate, bend = _commanded_damping(trajectory, dips, joint)
        dips = np.clip(dips - rate / np.where(bend > 0, bend, np.inf), time[before], time[before + 1])
    return dips


def _check_damping(joint: Joint, time: FloatArray, damping: FloatArray) -> None:
    """Raise an error if the damping vanishes somewhere, but not everywhere."""
    least = damping.argmin()
    if damping[least] <= VANISHING * damping.max() and damping.any():
        raise InputError.one(
            f"the damping of {joint.name} is {damping[least]:.6g} at t = {time_text(float(time[least]))}; "
            "parallel to springs it must be positive all the time, or zero all the time, since what moves "
            "inside is a state only while it is damped"
        )
