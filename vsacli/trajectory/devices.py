"""What devices of the joints do along a trajectory: as commanded, or by themselves."""

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
"""Times at which damping is looked at, beside all breakpoints: whether there is any."""


def with_devices(trajectory: Trajectory, robot: Robot) -> Trajectory:
    """The trajectory of a robot whose dampers, if none is commanded, stand at their least; a note says so.

    Raises:
        InputError: the damping parallel to the springs of a joint falls to zero, or below, somewhere but not
            everywhere.
    """
    if DAMPING.key not in trajectory.commanded and any(joint.damper for joint in robot.joints):
        trajectory = _with_least_damping(trajectory, robot)
    inside = [index for index, joint in enumerate(robot.joints) if joint.damper_at("transmission")]
    if inside:
        time = np.union1d(np.linspace(*trajectory.times.span, SEEN), trajectory.breakpoints)
        damping = trajectory.at(time).commanded[DAMPING.key]
        for index in inside:
            _check_damping(robot.joints[index], time, damping[:, index])
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


def _check_damping(joint: Joint, time: FloatArray, damping: FloatArray) -> None:
    """Refuse a damping that vanishes on the way."""
    vanishes = damping <= 0
    if vanishes.any() and damping.any():
        raise InputError.one(
            f"the damping of {joint.name} is {damping[vanishes][0]:g} at t = "
            f"{time_text(float(time[vanishes][0]))}; parallel to springs it must be positive all the time, "
            "or zero all the time, since what moves inside is a state only while it is damped"
        )
