"""Rigid motions as 4x4 matrices, and bodies that move with them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray


def transform(rotation: FloatArray, origin: FloatArray) -> FloatArray:
    """The pose of a frame with these axes (columns) and this origin."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, origin
    return pose


def pose_matrix(xyz: Iterable[float], rpy: Iterable[float]) -> FloatArray:
    """The pose of an `origin`: at xyz, with the axes of Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in rpy)
    rotation = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return transform(rotation, np.array(list(xyz)))


def roll_pitch_yaw(rotation: FloatArray) -> tuple[float, float, float]:
    """Angles with which `pose_matrix` gives this rotation, to rounding even where roll and yaw are one."""
    r = rotation
    yaw = math.atan2(r[1, 0], r[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    pitch = math.atan2(-r[2, 0], c * r[0, 0] + s * r[1, 0])
    roll = math.atan2(s * r[0, 2] - c * r[1, 2], c * r[1, 1] - s * r[0, 1])
    return roll, pitch, yaw


def inverse(pose: FloatArray) -> FloatArray:
    """The inverse of a rigid motion."""
    rotation = pose[:3, :3].T
    return transform(rotation, -rotation @ pose[:3, 3])


def cross_matrix(vector: FloatArray) -> FloatArray:
    """The matrix with which a vector multiplies from the left as a cross product."""
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


class Body(NamedTuple):
    """A rigid body: mass, centre of mass (3,), inertia about it (3, 3); in some frame."""

    mass: float
    com: FloatArray
    inertia: FloatArray

    def moved(self, pose: FloatArray) -> Body:
        """The body in the frame in which its own frame has this pose."""
        rotation = pose[:3, :3]
        return Body(self.mass, rotation @ self.com + pose[:3, 3], rotation @ self.inertia @ rotation.T)


def welded(bodies: list[Body]) -> Body:
    """Bodies of one frame as a single body (parallel axes); without mass, one at the origin."""
    mass = math.fsum(body.mass for body in bodies)
    moment = sum((body.mass * body.com for body in bodies), np.zeros(3))
    com = moment / mass if mass > 0 else np.zeros(3)
    inertia = sum((body.inertia + _steiner(body.mass, body.com - com) for body in bodies), np.zeros((3, 3)))
    return Body(mass, com, (inertia + inertia.T) / 2)


def _steiner(mass: float, arm: FloatArray) -> FloatArray:
    cross = cross_matrix(arm)
    result: FloatArray = -mass * cross @ cross
    return result
