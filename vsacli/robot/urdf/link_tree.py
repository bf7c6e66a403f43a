"""The links and joints of a URDF as a tree, and rigid motions of their frames."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import Problem
from vsacli.base.units import POSITION, Quantity


def transform(rotation: FloatArray, origin: FloatArray) -> FloatArray:
    """Return the pose of a frame, (4, 4), from its axes as columns and its origin."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, origin
    return pose


def pose_matrix(xyz: Iterable[float], rpy: Iterable[float]) -> FloatArray:
    """Return the pose of an `origin` element: at xyz, with the axes of Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in rpy)
    rotation = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return transform(rotation, np.array(list(xyz)))


def quaternion_rotation(quaternion: FloatArray) -> FloatArray:
    """Return the rotation matrix, (3, 3), of a unit quaternion x, y, z, w, by Rodrigues' formula."""
    cross = cross_matrix(quaternion[:3])
    rotation: FloatArray = np.eye(3) + 2 * (quaternion[3] * cross + cross @ cross)
    return rotation


def roll_pitch_yaw(rotation: FloatArray) -> tuple[float, float, float]:
    """Return angles with which `pose_matrix` gives this rotation, up to rounding, also in gimbal lock."""
    r = rotation
    yaw = math.atan2(r[1, 0], r[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    pitch = math.atan2(-r[2, 0], c * r[0, 0] + s * r[1, 0])
    roll = math.atan2(s * r[0, 2] - c * r[1, 2], c * r[1, 1] - s * r[0, 1])
    return roll, pitch, yaw


def inverse_pose(pose: FloatArray) -> FloatArray:
    """Return the inverse of a rigid motion."""
    rotation = pose[:3, :3].T
    return transform(rotation, -rotation @ pose[:3, 3])


def cross_matrix(vector: FloatArray) -> FloatArray:
    """Return the matrix of the cross product with a vector from the left."""
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


class RigidBody(NamedTuple):
    """A rigid body in some frame: mass, kg, center of mass, (3,), m, inertia about it, (3, 3), kg m^2."""

    mass: float
    com: FloatArray
    inertia: FloatArray

    def in_outer_frame(self, pose: FloatArray) -> RigidBody:
        """Return the body in another frame, in which its own frame has this pose."""
        rotation = pose[:3, :3]
        return RigidBody(self.mass, rotation @ self.com + pose[:3, 3], rotation @ self.inertia @ rotation.T)


def weld_bodies(bodies: list[RigidBody]) -> RigidBody:
    """Return bodies given in one frame as a single body; without mass, it is at the origin."""
    mass = math.fsum(body.mass for body in bodies)
    moment = sum((body.mass * body.com for body in bodies), np.zeros(3))
    com = moment / mass if mass > 0 else np.zeros(3)
    inertia = sum(
        (body.inertia + _parallel_axis_inertia(body.mass, body.com - com) for body in bodies),
        np.zeros((3, 3)),
    )
    return RigidBody(mass, com, (inertia + inertia.T) / 2)


def _parallel_axis_inertia(mass: float, arm: FloatArray) -> FloatArray:
    cross = cross_matrix(arm)
    result: FloatArray = -mass * cross @ cross
    return result


ROTATING = ("revolute", "continuous")
MOVING = (*ROTATING, "prismatic")
"""Types of joints with one degree of freedom."""

TYPES = (*MOVING, "fixed", "floating", "planar")

LARGEST_NUMBER = 1e9
"""Largest number; beyond, none is a length, mass or inertia of a robot, and products would overflow."""


@dataclass(frozen=True)
class UrdfLink:
    """A link; `body` is in its own frame, None if the file gives no inertial data.

    `flaw` is the line of incomplete inertial data and the missing part, an error only if the link moves.
    """

    name: str
    line: int
    body: RigidBody | None
    flaw: tuple[int, str] | None = None


POSITION_LIMITS = "position limits"
"""Beginning of phrases on position limits that are not taken over."""

UNLIMITED = (-LARGEST_NUMBER, LARGEST_NUMBER)
"""Position limits that bound nothing."""


@dataclass(frozen=True)
class UrdfLimit:
    """Limits of a joint; None if the file gives none, or one that bounds nothing."""

    position: tuple[float, float] | None = None
    velocity: float | None = None
    effort: float | None = None


@dataclass(frozen=True)
class Mimic:
    """The relation of a joint to its leader: `multiplier` times the position of `leader`, plus `offset`."""

    leader: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class UrdfJoint:
    """A joint; at position zero its child has the pose `placement` in its parent.

    `gear_ratio` is the motion of its only motor over its own, None if 1 or unknown; `left_out` has a phrase
    for each property that is not taken over, and its value, which may be empty.
    """

    name: str
    line: int
    type: str
    parent: str
    child: str
    placement: FloatArray
    axis: FloatArray
    limit: UrdfLimit
    damping: float
    mimic: Mimic | None
    gear_ratio: float | None
    left_out: tuple[tuple[str, str], ...]

    @property
    def is_fixed(self) -> bool:
        """Whether the joint connects its links rigidly."""
        return self.type == "fixed"

    @property
    def is_revolute(self) -> bool:
        """Whether the joint rotates."""
        return self.type in ROTATING

    def unit(self, quantity: Quantity = POSITION) -> str:
        """Return the unit of a quantity of the joint."""
        return quantity.unit("revolute" if self.is_revolute else "prismatic")

    def motions(self, positions: FloatArray) -> FloatArray:
        """Return motions of the child, (samples, 4, 4), at positions, (samples,), by Rodrigues' formula."""
        poses = np.tile(np.eye(4), (len(positions), 1, 1))
        if not self.is_revolute:
            poses[:, :3, 3] = np.outer(positions, self.axis)
            return poses
        cross = cross_matrix(self.axis)
        angle = positions[:, None, None]
        poses[:, :3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
        return poses


@dataclass(frozen=True)
class Urdf:
    """A robot as a tree of links.

    Attributes:
        file: path of the file as given.
        name: name of the robot.
        links: links by name.
        joints: joints by name.
        root: name of the link without a parent.
        warnings: words of the file that are ignored, and implausible orientations, by line.
    """

    file: str
    name: str
    links: Mapping[str, UrdfLink]
    joints: Mapping[str, UrdfJoint]
    root: str
    warnings: tuple[Problem, ...] = ()

    def joints_above(self, link: str) -> list[UrdfJoint]:
        """Return the joints between the root and a link, from the root."""
        parents = {joint.child: joint for joint in self.joints.values()}
        path = []
        while link in parents:
            path.append(parents[link])
            link = parents[link].parent
        return path[::-1]

    def relation_to_leader(self, joint: UrdfJoint, released: Collection[str] = ()) -> Mimic:
        """Return the relation to the last leader in a chain of mimics; to itself without a leader.

        Joints named in `released` follow none.
        """
        mimic = Mimic(joint.name)
        while (
            mimic.leader not in released
            and (further := self.joints[mimic.leader].mimic) is not None
            and further.leader in self.joints
        ):
            multiplier, offset = mimic.multiplier, mimic.offset
            mimic = Mimic(
                further.leader, multiplier * further.multiplier, multiplier * further.offset + offset
            )
        return mimic


def joints_below(link: str, joints: Iterable[UrdfJoint]) -> Iterator[UrdfJoint]:
    """Yield the joints below a link, parents before children."""
    children: dict[str, list[UrdfJoint]] = {}
    for joint in joints:
        children.setdefault(joint.parent, []).append(joint)
    waiting = [link]
    while waiting:
        for joint in children.get(waiting.pop(), ()):
            yield joint
            waiting.append(joint.child)
