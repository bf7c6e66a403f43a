"""Links and joints of a URDF as a tree, rigid motions of their frames, and which joints move."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError, Problem
from vsacli.base.units import POSITION, Quantity
from vsacli.documents.tree import quoted


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
    return -mass * cross @ cross


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


class MovingJoints(NamedTuple):
    """The joints that move, and the links between which they are.

    Attributes:
        base: link that is fixed to the ground.
        tips: links of the end effectors.
        joints: joints, each after the one that carries it, branch by branch in the order of the file.
        names: names of the joints.
        whole: whether all joints below the base move that can, rather than those before chosen tips.
        shape: "chain" or "tree".
    """

    base: str
    tips: tuple[str, ...]
    joints: tuple[UrdfJoint, ...]
    names: tuple[str, ...]
    whole: bool
    shape: str


def choose_moving_joints(
    urdf: Urdf, base: str | None, tips: Collection[str], held: Collection[str]
) -> MovingJoints:
    """Return the joints between a base link (None: the root) and tip links (none: the end of each branch).

    Args:
        urdf: robot.
        base: name of the base link.
        tips: names of the tip links.
        held: names of joints that do not move although nothing else prevents it, if there are no `tips`.

    Raises:
        InputError: a link or path does not exist, or no joint moves on it.
    """
    start = urdf.root if base is None else _check_link_name(urdf, base, "--base")
    chosen = tuple(dict.fromkeys(_check_link_name(urdf, tip, "--tip") for tip in tips))
    names = {joint.name for tip in chosen for joint in _moving_between(urdf, start, tip)}
    joints = _sort_by_branch(urdf, names if chosen else _joints_of_whole_robot(urdf, start, held))
    if not joints:
        raise InputError.one(f"no joint moves below {quoted(start)}", urdf.file)
    last = _last_joints(urdf, joints)
    ends = chosen or tuple(_end_of_fixed_links(urdf, joint.child) for joint in last)
    return MovingJoints(
        base=start,
        tips=ends,
        joints=joints,
        names=tuple(joint.name for joint in joints),
        whole=not chosen,
        shape="chain" if len(last) == 1 else "tree",
    )


def _check_link_name(urdf: Urdf, name: str, option: str) -> str:
    if name not in urdf.links:
        near = did_you_mean(name, urdf.links)
        raise InputError.one(f"{option}: there is no link {quoted(name)}{near}", urdf.file)
    return name


def _moving_between(urdf: Urdf, base: str, tip: str) -> list[UrdfJoint]:
    """Return the joints of the path from one link to another that are not fixed."""
    above = urdf.joints_above(tip)
    links = [joint.parent for joint in above] + [tip]
    if base not in links:
        raise InputError.one(f"the link {quoted(tip)} does not hang below {quoted(base)}", urdf.file)
    if base == tip:
        same = f"--base and --tip are the same link, {quoted(base)}"
        raise InputError.one(f"{same}; choose a base nearer to the root, or a tip below it", urdf.file)
    moving = [joint for joint in above[links.index(base) :] if not joint.is_fixed]
    if not moving:
        message = f"no joint moves between {quoted(base)} and {quoted(tip)}; choose another base or tip"
        raise InputError.one(message, urdf.file)
    return moving


def _joints_of_whole_robot(urdf: Urdf, base: str, held: Collection[str]) -> set[str]:
    """Return the names of joints below a link that have a drive of their own, and are not held.

    Joints beyond one that follows such a joint without mass are none: they are on a branch that is left out.
    Joints of several degrees of freedom are none on the base, where they are held; elsewhere they are, and
    refused.
    """
    below = list(joints_below(base, urdf.joints.values()))
    driven = {
        joint.name
        for joint in below
        if joint.type in MOVING and joint.mimic is None and joint.name not in held
    }
    left_out = {
        further.name
        for joint in below
        if joint.name not in driven and urdf.relation_to_leader(joint, held).leader in driven
        if is_massless(urdf, joint)
        for further in joints_below(joint.child, below)
    }
    refused = {
        joint.name
        for joint in below
        if not (joint.is_fixed or joint.type in MOVING)
        and any(above.name in driven for above in urdf.joints_above(joint.parent))
    }
    return (driven | refused) - left_out


def is_massless(urdf: Urdf, joint: UrdfJoint) -> bool:
    """Return whether a joint moves links without mass only, so that it exerts no torque on its leader."""
    links = [urdf.links[moved.child] for moved in (joint, *joints_below(joint.child, urdf.joints.values()))]
    return not any(link.flaw or (link.body and (link.body.mass or link.body.inertia.any())) for link in links)


def _sort_by_branch(urdf: Urdf, names: Collection[str]) -> tuple[UrdfJoint, ...]:
    """Return joints depth first, siblings in the order of the file."""
    number = {name: index for index, name in enumerate(urdf.joints)}
    paths = {name: urdf.joints_above(urdf.joints[name].child) for name in names}
    order = sorted(names, key=lambda name: [number[joint.name] for joint in paths[name]])
    return tuple(urdf.joints[name] for name in order)


def _last_joints(urdf: Urdf, joints: Sequence[UrdfJoint]) -> list[UrdfJoint]:
    """Return the joints that carry no other of them."""
    carrying = {above.name for joint in joints for above in urdf.joints_above(joint.parent)}
    return [joint for joint in joints if joint.name not in carrying]


def _end_of_fixed_links(urdf: Urdf, link: str) -> str:
    """Return the last of the links that are fixed one to the other, before they branch."""
    while len(fixed := _fixed_links(urdf, link)) == 1:
        (link,) = fixed
    return link


def _fixed_links(urdf: Urdf, link: str) -> list[str]:
    """Return the links that fixed joints connect to their parent link."""
    return [joint.child for joint in urdf.joints.values() if joint.parent == link and joint.is_fixed]


def fixed_ends(urdf: Urdf, link: str) -> list[str]:
    """Return the last links of the branches of fixed joints on a link; none without branches."""
    fixed = joints_below(link, (joint for joint in urdf.joints.values() if joint.is_fixed))
    return [joint.child for joint in fixed if not _fixed_links(urdf, joint.child)]
