"""Limits of a joint, including those of its actuator, and the flags where they are exceeded."""

from __future__ import annotations

import math

import numpy as np

from vsacli.actuators.reach import LimitCheck, OfJoint
from vsacli.base.arrays import FLAG_TYPE, BoolArray, FlagArray
from vsacli.base.flags import Flag
from vsacli.base.signals import DAMPING
from vsacli.robot.joint import Joint


def limit_checks(joint: Joint) -> list[LimitCheck]:
    """Return the finite limits of a joint."""
    limits = joint.limits
    checks = [
        LimitCheck(Flag.POSITION_LIMIT, "q", None, limits.position),
        LimitCheck(Flag.VELOCITY_LIMIT, "dq", None, limits.velocity),
        LimitCheck(Flag.STIFFNESS_LIMIT, "stiffness", None, limits.stiffness),
    ]
    if joint.damper is not None:
        checks.append(LimitCheck(Flag.DAMPING_LIMIT, DAMPING.key, None, joint.damper.range))
    checks += joint.actuator.limits()
    return [check for check in checks if any(map(math.isfinite, check.range))]


def limit_flags(joint: Joint, of_joint: OfJoint, flags: FlagArray) -> FlagArray:
    """Return `flags`, (samples,), with the bits of all limits on variables that are given.

    Where the standard deviation of a variable is given, its limit is exceeded only beyond the allowance.
    """
    for check in limit_checks(joint):
        if check.variable in of_joint:
            flags = flags | check.flags(of_joint, check.allowance(of_joint))
    return flags


def open_steps(joint: Joint, of_joint: OfJoint) -> BoolArray:
    """Return the samples at which standard deviations decide whether limits are exceeded, (samples,).

    A value is beyond a limit there, but none by more than the largest allowance.
    """
    beyond, too_far = np.zeros((2, len(of_joint["flags"])), dtype=FLAG_TYPE)
    for check in limit_checks(joint):
        if check.variable in of_joint:
            beyond |= check.flags(of_joint)
            too_far |= check.flags(of_joint, check.largest_allowance)
    found: BoolArray = (beyond != 0) & (too_far == 0)
    return found
