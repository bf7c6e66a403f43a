"""From a tree of links to one serial chain: which joints move, and what each of them carries.

Everything is given at the zero position of all joints, in the axes of the base link, so that the chain is a
list of lines in space, a body for each, and the pose of the tip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.documents.problems import Problems
from vsacli.documents.tree import quoted
from vsacli.robot.urdf.chain_ends import ChainPath, find_path
from vsacli.robot.urdf.link_tree import MOVING, ROTATING, Urdf, UrdfJoint, UrdfLink, below
from vsacli.robot.urdf.rigid_motion import Body, inverse, welded


@dataclass(frozen=True)
class ChainJoint:
    """A joint that moves.

    Attributes:
        urdf: the joint as its file describes it.
        frame: pose of its URDF frame, (4, 4).
        links: those it carries rigidly, its own first.
        body: these links as one.
    """

    urdf: UrdfJoint
    frame: FloatArray
    links: tuple[UrdfLink, ...]
    body: Body

    @property
    def is_revolute(self) -> bool:
        """Whether it turns."""
        return self.urdf.type in ROTATING

    @property
    def origin(self) -> FloatArray:
        """A point of its axis, (3,)."""
        return self.frame[:3, 3]

    @property
    def direction(self) -> FloatArray:
        """The unit vector along its axis, (3,)."""
        result: FloatArray = self.frame[:3, :3] @ self.urdf.axis
        return result


@dataclass(frozen=True)
class SerialChain:
    """A serial chain at position zero, in the frame of its base link.

    Attributes:
        robot_name: name of the robot.
        base: name of the base link.
        tip: name of the tip link.
        up: direction of the root link's z axis, (3,).
        joints: those that move, from the base.
        tip_pose: pose of the tip link, (4, 4).
        held_below: joints between root and base that could move.
        held_beside: joints on side branches that could move.
    """

    robot_name: str
    base: str
    tip: str
    up: FloatArray
    joints: tuple[ChainJoint, ...]
    tip_pose: FloatArray
    held_below: tuple[str, ...]
    held_beside: tuple[str, ...]


def serial_chain(urdf: Urdf, base: str | None = None, tip: str | None = None) -> SerialChain:
    """The chain from a base link (the root if None) to a tip link (the only one there is if None).

    Raises:
        InputError: there is no such chain, or it has joints that no serial robot can have.
    """
    path = find_path(urdf, base, tip)
    carried = _carried(urdf, path)
    beside = _held_beside(urdf, carried, path)
    _check_joints(urdf, path, beside)
    poses = _poses(urdf)
    to_base = inverse(poses[path.base])
    return SerialChain(
        robot_name=urdf.name,
        base=path.base,
        tip=path.tip,
        up=to_base[:3, 2],
        joints=tuple(
            ChainJoint(joint, to_base @ poses[joint.child], links, _body(links, poses, to_base))
            for joint, links in zip(path.moving, carried, strict=True)
        ),
        tip_pose=to_base @ poses[path.tip],
        held_below=tuple(joint.name for joint in urdf.above(path.base) if not joint.is_fixed),
        held_beside=tuple(joint.name for joint in beside),
    )


def _check_joints(urdf: Urdf, path: ChainPath, beside: list[UrdfJoint]) -> None:
    """Refuse joints without a drive of their own, and side branches that such a drive moves along."""
    problems = Problems(urdf.file)
    for joint in path.moving:
        name = f"joint {quoted(joint.name)}"
        if joint.type not in MOVING:
            reason = f"is {joint.type}; a chain has revolute, continuous and prismatic joints"
            problems.add(joint.line, f"{name} {reason}; choose base and tip beside it")
        if joint.mimics is not None:
            reason = f"follows {quoted(joint.mimics)} (<mimic>), so it has no drive of its own"
            problems.add(joint.line, f"{name} {reason}; choose a tip before it")
    on_chain = {joint.name for joint in path.moving}
    for joint in beside:
        if joint.mimics in on_chain:
            reason = f"beside the chain follows {quoted(joint.mimics or '')} on it (<mimic>)"
            problems.add(joint.line, f"joint {quoted(joint.name)} {reason}; choose a tip before these two")
    problems.check()


def _poses(urdf: Urdf) -> dict[str, FloatArray]:
    """The pose of every link in the root, at position zero."""
    poses = {urdf.root: np.eye(4)}
    for joint in below(urdf.root, urdf.joints.values()):
        poses[joint.child] = poses[joint.parent] @ joint.placement
    return poses


def _carried(urdf: Urdf, path: ChainPath) -> list[tuple[UrdfLink, ...]]:
    """The links that each moving joint of the chain carries, side branches included."""
    number = {joint.name: index for index, joint in enumerate(path.moving)}
    owner = {path.base: -1}
    carried: list[list[UrdfLink]] = [[] for _ in number]
    for joint in below(path.base, urdf.joints.values()):
        index = owner[joint.child] = number.get(joint.name, owner[joint.parent])
        if index >= 0:
            carried[index].append(urdf.links[joint.child])
    return [tuple(links) for links in carried]


def _held_beside(urdf: Urdf, carried: list[tuple[UrdfLink, ...]], path: ChainPath) -> list[UrdfJoint]:
    """Joints that could move on side branches."""
    names = {link.name for links in carried for link in links}
    moving = {joint.name for joint in path.moving}
    candidates = (joint for joint in urdf.joints.values() if joint.child in names and not joint.is_fixed)
    return [joint for joint in candidates if joint.name not in moving]


def _body(links: tuple[UrdfLink, ...], poses: dict[str, FloatArray], to_base: FloatArray) -> Body:
    return welded([link.body.moved(to_base @ poses[link.name]) for link in links if link.body is not None])
