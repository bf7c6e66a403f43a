"""How far a robot reaches, and what its own weight demands of its joints."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.dynamics.link_torques import base_gravity
from vsacli.files.info.extremes import Extremes, free_range, largest, unlimited
from vsacli.robot.model import Joint, Robot


class Frame(NamedTuple):
    """A DH frame in frame 0: axes as columns, (samples, 3, 3), and origin, (samples, 3) m."""

    axes: FloatArray
    origin: FloatArray

    def point(self, local: tuple[float, float, float]) -> FloatArray:
        """A point given in this frame, (samples, 3)."""
        return np.asarray(self.axes @ np.array(local) + self.origin)


def frames(robot: Robot, q: FloatArray) -> Iterator[Frame]:
    """Frames 0 to N at positions q, (samples, joints)."""
    frame = Frame(np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3)))
    yield frame
    for joint, variable in zip(robot.joints, q.T, strict=True):
        axes, origin = _row(joint, variable)
        frame = Frame(frame.axes @ axes, (frame.axes @ origin[..., None])[..., 0] + frame.origin)
        yield frame


def _row(joint: Joint, variable: FloatArray) -> Frame:
    """Frame i in frame i-1: Rz(theta) Tz(d) Tx(a) Rx(alpha)."""
    dh, zero = joint.dh, np.zeros_like(variable)
    theta, d = (dh.theta + variable, dh.d + zero) if joint.is_revolute else (dh.theta + zero, dh.d + variable)
    c, s, ca, sa = np.cos(theta), np.sin(theta), math.cos(dh.alpha), math.sin(dh.alpha)
    rows = [[c, -s * ca, s * sa], [s, c * ca, -c * sa], [zero, zero + sa, zero + ca]]
    return Frame(np.moveaxis(np.array(rows), -1, 0), np.stack([dh.a * c, dh.a * s, d], axis=-1))


def tip_position(robot: Robot, q: FloatArray) -> FloatArray:
    """Origin of the end effector's frame in DH frame 0, (samples, 3) m, at q of (samples, joints)."""
    *_, last = frames(robot, q)
    return last.point(robot.tool.xyz)


def gravity_torques(robot: Robot, q: FloatArray) -> FloatArray:
    """Torques that hold the links still, (samples, joints), N m (N), at q of (samples, joints).

    Moment of the weight of all links beyond a joint about its axis, or weight along it.
    """
    gravity = np.array([float(component) for component in base_gravity(robot)])
    chain = list(frames(robot, q))
    torques, mass, moment = np.empty_like(q), 0.0, np.zeros((len(q), 3))
    for index, joint in reversed(list(enumerate(robot.joints))):
        mass += joint.link.mass
        moment += joint.link.mass * chain[index + 1].point(joint.link.com)
        axis = chain[index].axes[..., 2]
        arm = np.cross(axis, moment - mass * chain[index].origin) if joint.is_revolute else mass * axis
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
