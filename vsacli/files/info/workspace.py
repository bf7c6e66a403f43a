"""How far a robot reaches, and what its own weight demands of its joints."""

from __future__ import annotations

import math

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.files.info.extremes import Extremes, free_range, largest, unlimited
from vsacli.robot.kinematics import base_gravity, frames, tip_position
from vsacli.robot.model import Joint, Robot


def gravity_torques(robot: Robot, q: FloatArray) -> FloatArray:
    """Torques that hold the links still, (samples, joints), N m (N), at q of (samples, joints).

    Moment of the weight of all links beyond a joint about its axis, or weight along it.
    """
    gravity = np.array([float(component) for component in base_gravity(robot)])
    poses = list(frames(robot, q))
    torques, mass, moment = np.empty_like(q), 0.0, np.zeros((len(q), 3))
    for index, joint in reversed(list(enumerate(robot.joints))):
        mass += joint.link.mass
        moment += joint.link.mass * poses[index + 1].point(joint.link.com)
        axis = poses[index].axes[..., 2]
        arm = np.cross(axis, moment - mass * poses[index].origin) if joint.is_revolute else mass * axis
        torques[:, index] = -arm @ gravity
    return torques


def reach(robot: Robot) -> Extremes:
    """The largest distance of the end effector's frame from the origin of DH frame 0 that was found, m."""

    def squared(q: FloatArray) -> FloatArray:
        position = tip_position(robot, q)
        return np.asarray(np.sum(position * position, axis=1, keepdims=True))

    found = largest(squared, 1, robot)
    return found._replace(values=np.sqrt(found.values))


def reach_bound(robot: Robot) -> float:
    """No configuration takes the end effector's frame farther than this from the origin of DH frame 0, m.

    The sum of the lengths of all links, of prismatic joints at the end of their range that is farther.
    """
    return sum(map(_length, robot.joints)) + math.hypot(*robot.tool.xyz)


def _length(joint: Joint) -> float:
    ends = (0.0,) if joint.is_revolute else free_range(joint)
    return math.hypot(joint.dh.a, max(abs(joint.dh.d + end) for end in ends))


def static_load(robot: Robot) -> Extremes:
    """The largest |torque| that gravity alone demands of each joint, N m (N), as far as was found."""
    return largest(lambda q: gravity_torques(robot, q), len(robot.joints), robot)


def held(robot: Robot) -> list[str]:
    """Prismatic joints without both position limits, which reach and load take to stand at zero."""
    return [joint.name for joint in robot.joints if unlimited(joint)]
