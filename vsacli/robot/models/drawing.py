"""How thick and how long the rods are that are drawn for links."""

from __future__ import annotations

import math

from vsacli.robot.model import Robot

THICKNESS_SHARE = 0.07
"""Radius of a rod as a share of the mean length of links."""

WITHOUT_LENGTH = 0.5
"""Length, m, of an arm all of whose origins are one."""


def arm_length(robot: Robot) -> float:
    """Sum of the distances from origin to origin at q = 0, m."""
    return math.fsum(math.hypot(joint.dh.a, joint.dh.d) for joint in robot.joints) or WITHOUT_LENGTH


def rod_radius(robot: Robot) -> float:
    """Of the rods from origin to origin, m."""
    return THICKNESS_SHARE * arm_length(robot) / len(robot.joints)
