"""Where the frames of a robot lie: forward kinematics by its rows, rotations of poses, gravity in frame 0."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.vector import Matrix, Vector, add, exact, mul, sub, trigonometric
from vsacli.robot.model import Joint, Pose, Robot


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
        axes, origin = _link_frame(joint, variable)
        frame = Frame(frame.axes @ axes, (frame.axes @ origin[..., None])[..., 0] + frame.origin)
        yield frame


def _link_frame(joint: Joint, variable: FloatArray) -> Frame:
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


def rotation_matrix(pose: Pose) -> Matrix:
    """Rz(yaw) Ry(pitch) Rx(roll), with exact zeros and ones at right angles."""
    (cr, cp, cy), (sr, sp, sy) = (
        [trigonometric(function, angle) for angle in pose.rpy] for function in (math.cos, math.sin)
    )
    return Matrix(
        Vector(mul(cy, cp), sub(mul(mul(cy, sp), sr), mul(sy, cr)), add(mul(mul(cy, sp), cr), mul(sy, sr))),
        Vector(mul(sy, cp), add(mul(mul(sy, sp), sr), mul(cy, cr)), sub(mul(mul(sy, sp), cr), mul(cy, sr))),
        Vector(sub(0, sp), mul(cp, sr), mul(cp, cr)),
    )


def base_gravity(robot: Robot) -> Vector:
    """Gravity acceleration in DH frame 0, m/s^2."""
    return rotation_matrix(robot.base).transposed().times(Vector(*map(exact, robot.gravity)))
