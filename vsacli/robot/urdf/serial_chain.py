"""From a tree of links to one serial chain: which joints move, and what each of them carries.

Everything is given at the zero position of all joints, in the axes of the base link, so that the chain is a
list of lines in space, a body for each, and the pose of the tip.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.documents.source import Problems
from vsacli.documents.tree import quoted
from vsacli.robot.urdf.link_tree import MOVING, ROTATING, Urdf, UrdfJoint, UrdfLink, below
from vsacli.robot.urdf.rigid_motion import Body, inverse, welded

MAX_TIPS = 12
"""Links that a message offers as tip."""


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
    path = _find_path(urdf, base, tip)
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


class ChainPath(NamedTuple):
    """The joints from one link to another, fixed ones included."""

    base: str
    tip: str
    joints: tuple[UrdfJoint, ...]

    @property
    def moving(self) -> tuple[UrdfJoint, ...]:
        """Joints of the path that are not fixed."""
        return tuple(joint for joint in self.joints if not joint.is_fixed)


def _find_path(urdf: Urdf, base: str | None, tip: str | None) -> ChainPath:
    """The path from a base link (the root if None) to a tip link (the only one there can be if None).

    Raises:
        InputError: there is no such link or path, or no joint moves on it.
    """
    start = urdf.root if base is None else _known(urdf, base, "base")
    end = _only_tip(urdf, start) if tip is None else _known(urdf, tip, "tip")
    path = _path(urdf, start, end)
    if not path.moving:
        raise InputError.one(f"no joint moves between {quoted(start)} and {quoted(end)}", urdf.file)
    return path


def _known(urdf: Urdf, name: str, end: str) -> str:
    if name not in urdf.links:
        near = did_you_mean(name, urdf.links)
        raise InputError.one(f"{end}: there is no link {quoted(name)}{near}", urdf.file)
    return name


def _path(urdf: Urdf, base: str, tip: str) -> ChainPath:
    above = urdf.above(tip)
    links = [joint.parent for joint in above] + [tip]
    if base not in links:
        raise InputError.one(f"the link {quoted(tip)} does not hang below {quoted(base)}", urdf.file)
    return ChainPath(base, tip, tuple(above[links.index(base) :]))


def _only_tip(urdf: Urdf, base: str) -> str:
    """The end of the only branch that moves, if only one link could be meant by that."""
    leaves = {leaf: _path(urdf, base, leaf).moving for leaf in _leaves(urdf, base)}
    longest = max(leaves.values(), key=len, default=())
    tips = [leaf for leaf, moving in leaves.items() if moving and moving == longest]
    straight = all(moving == longest[: len(moving)] for moving in leaves.values())
    if not longest:
        raise InputError.one(f"no joint moves below {quoted(base)}", urdf.file)
    if not straight or len(tips) > 1:
        offered = [*_forks(urdf, base), *(leaf for leaf, moving in leaves.items() if moving)]
        raise InputError.one(_ambiguous(urdf, base, list(dict.fromkeys(offered))), urdf.file)
    return tips[0]


def _leaves(urdf: Urdf, base: str) -> list[str]:
    joints = list(below(base, urdf.joints.values()))
    parents = {joint.parent for joint in joints}
    return [joint.child for joint in joints if joint.child not in parents]


def _forks(urdf: Urdf, base: str) -> Iterator[str]:
    """Links behind a moving joint from which more than one branch with moving joints goes on."""
    branches: dict[str, set[str]] = {}
    for moving in (joint for joint in below(base, urdf.joints.values()) if not joint.is_fixed):
        for joint in _path(urdf, base, moving.child).joints:
            branches.setdefault(joint.parent, set()).add(joint.child)
    for link, ways in branches.items():
        if len(ways) > 1 and _path(urdf, base, link).moving:
            yield link


def _ambiguous(urdf: Urdf, base: str, tips: list[str]) -> str:
    counts = [len(_path(urdf, base, tip).moving) for tip in tips]
    found = [f"{tip} ({count} joint{'s'[: count > 1]})" for tip, count in zip(tips, counts, strict=True)]
    more = f" and {len(found) - MAX_TIPS} more" if len(found) > MAX_TIPS else ""
    offered = ", ".join(found[:MAX_TIPS])
    which = f"several links below {quoted(base)} could be the end effector"
    return f"{which}; choose one with --tip: {offered}{more}"
