"""The limits of a joint: its own, and those of its actuator."""

from __future__ import annotations

import math

import numpy as np

from vsacli.actuators.drivetrain import motors_and_springs
from vsacli.actuators.limit_check import LimitCheck, OfJoint, within
from vsacli.base.arrays import FlagArray
from vsacli.base.flags import Flag
from vsacli.robot.model import Joint


def limit_checks(joint: Joint) -> list[LimitCheck]:
    """The limits that a joint has."""
    limits = joint.limits
    checks = [
        LimitCheck(Flag.POSITION_LIMIT, "q", None, limits.position),
        LimitCheck(Flag.VELOCITY_LIMIT, "dq", None, limits.velocity),
        LimitCheck(Flag.STIFFNESS_LIMIT, "stiffness", None, limits.stiffness),
    ]
    for motor, (drive, spring) in enumerate(motors_and_springs(joint.actuator), start=1):
        deflection = math.inf if spring is None else spring.max_deflection
        checks += [
            LimitCheck(Flag.DEFLECTION_LIMIT, "phi", motor, within(deflection)),
            LimitCheck(Flag.MOTOR_VELOCITY_LIMIT, "dtheta", motor, within(drive.max_velocity)),
            LimitCheck(Flag.MOTOR_TORQUE_LIMIT, "tau_motor", motor, within(drive.max_torque)),
        ]
    return [check for check in checks if np.isfinite(check.range).any()]


def limit_flags(joint: Joint, of_joint: OfJoint, flags: FlagArray) -> FlagArray:
    """The flags, (samples,), and those of all limits of a joint on variables that are given."""
    for check in limit_checks(joint):
        if check.variable in of_joint:
            flags = flags | check.flags(of_joint)
    return flags
