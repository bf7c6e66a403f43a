"""The chain or tree of moving joints of a URDF, with the links that each joint carries.

Links behind fixed and held joints move with the joint that carries them.
"""

from __future__ import annotations

import shlex
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.documents.expression import ExpressionError
from vsacli.documents.number import evaluate
from vsacli.documents.source import Problems
from vsacli.documents.tree import quoted
from vsacli.robot.urdf.link_tree import (
    LARGEST_NUMBER,
    MOVING,
    MovingJoints,
    RigidBody,
    Urdf,
    UrdfJoint,
    UrdfLink,
    choose_moving_joints,
    fixed_ends,
    inverse_pose,
    is_massless,
    joints_below,
    weld_bodies,
)

Hold = Mapping[str, float | str]
"""Positions of held joints by name, rad (m), or texts such as "90 deg"."""

LIMIT_ROUNDING = 1e-9
"""Distance, rad or m, by which a held joint may be beyond a limit without a warning."""


class HeldJoint(NamedTuple):
    """A joint that could move but is held.

    Attributes:
        urdf: joint of the URDF.
        position: position at which it is held, rad (m).
        leader: name of the last leader in a chain of mimics; its own without an existing leader.
        released: whether it is held although it follows a joint that moves.
    """

    urdf: UrdfJoint
    position: float
    leader: str
    released: bool = False

    @property
    def follows(self) -> bool:
        """Whether its position follows from another joint."""
        return self.leader != self.urdf.name

    def __str__(self) -> str:
        following = f" (follows {self.leader})" if self.follows else ""
        return f"{self.urdf.name} at {self.position:.6g} {self.urdf.unit()}{following}"

    def warnings(self) -> Iterator[str]:
        """Yield warnings that the position may be wrong, with a fix."""
        mimic, limit = self.urdf.mimic, self.urdf.limit.position
        if mimic is not None and self.released:
            yield f"{self}: it follows {mimic.leader} (<mimic>), and its motion with that joint is neglected"
        elif mimic is not None and not self.follows and self.position == _default_position(self.urdf):
            reason = f"there is no joint {quoted(mimic.leader)}, which it should follow (<mimic>)"
            yield f"{self}: {reason}; if it stands elsewhere, say so by --hold {self.leader}=VALUE"
        if limit is not None and not limit[0] - LIMIT_ROUNDING <= self.position <= limit[1] + LIMIT_ROUNDING:
            low, high = limit
            value = "VALUE" if self.follows else f"{max(low, min(high, self.position)):.6g}"
            limits = f"is outside its limits, {low:.6g} to {high:.6g} {self.urdf.unit()}"
            yield f"{self} {limits}; hold it elsewhere by --hold {self.leader}={value}"


def held_joints(
    urdf: Urdf, standing: Iterable[UrdfJoint], moving: MovingJoints, hold: Hold
) -> list[HeldJoint]:
    """Return held joints, at their given position, at one that follows from a leader, or at zero.

    Args:
        urdf: robot.
        standing: joints to hold.
        moving: joints that move.
        hold: positions of joints that follow no other, or one that moves.

    Raises:
        InputError: a position cannot be given, or has no effect.
    """
    followed = [(joint, urdf.relation_to_leader(joint, hold)) for joint in standing]
    leaders = {mimic.leader: _default_position(urdf.joints[mimic.leader]) for _, mimic in followed}
    problems = Problems(urdf.file)
    for name, value in hold.items():
        leaders[name] = _read_hold_position(urdf, name, value, leaders, moving, problems)
    problems.check()
    held = [
        HeldJoint(
            joint,
            mimic.multiplier * leaders[mimic.leader] + mimic.offset,
            mimic.leader,
            joint.name in hold and urdf.relation_to_leader(joint).leader in moving.names,
        )
        for joint, mimic in followed
    ]
    for joint, position, leader, _ in held:
        if not abs(position) <= LARGEST_NUMBER:
            message = f"following {quoted(leader)} it stands at {position:g} {joint.unit()}"
            problems.add(joint.line, f"joint {quoted(joint.name)}: {message}, more than can be computed with")
    problems.check()
    return held


def _default_position(joint: UrdfJoint) -> float:
    """Return the default position of a joint: zero, or that at which its missing leader is at zero."""
    return 0.0 if joint.mimic is None else joint.mimic.offset


def _read_hold_position(
    urdf: Urdf,
    name: str,
    value: float | str,
    leaders: Collection[str],
    moving: MovingJoints,
    problems: Problems,
) -> float:
    """Return the given position of a held joint; 0 after adding a problem."""
    option = f"--hold {name}={value}"
    reason = _reason_against(urdf, name, leaders, moving)
    if reason:
        problems.add(0, f"{option}: {reason}")
        return 0.0
    unit = urdf.joints[name].unit()
    try:
        return evaluate(str(value), unit)
    except ExpressionError as error:
        problems.add(0, f"{option}: {error}")
        return 0.0


def _reason_against(urdf: Urdf, name: str, leaders: Collection[str], moving: MovingJoints) -> str:
    """Return the reason why a joint cannot be held; empty if it can."""
    joint, shown = urdf.joints.get(name), quoted(name)
    if joint is None:
        return f"there is no joint {shown} outside the {moving.shape}{did_you_mean(name, leaders)}"
    if joint.type not in MOVING:
        return f"{shown} is {joint.type}, so it has no position to choose"
    if name in moving.names:
        return f"{shown} belongs to the {moving.shape}, where it moves"
    if (leader := urdf.relation_to_leader(joint).leader) != name and leader not in moving.names:
        return f"{shown} follows {quoted(leader)} (<mimic>); hold that one"
    if name not in leaders:
        return f"{shown} is neither outside the {moving.shape} nor below its base, so that it has no effect"
    return ""


STANDARD_GRAVITY = 9.81
"""Gravity, m/s^2, along -z of the root link; a URDF does not give any."""


@dataclass(frozen=True)
class MovingJoint:
    """A joint that moves, at position zero.

    Attributes:
        urdf: joint of the URDF.
        parent: index of the joint that carries it; -1 on the base.
        frame: pose of its URDF frame in the base link, (4, 4).
        links: links that it carries rigidly, its own first.
        body: these links as a single body, in the base link.
    """

    urdf: UrdfJoint
    parent: int
    frame: FloatArray
    links: tuple[UrdfLink, ...]
    body: RigidBody

    @property
    def is_revolute(self) -> bool:
        """Whether the joint rotates."""
        return self.urdf.is_revolute

    @property
    def origin(self) -> FloatArray:
        """Point on the joint axis, (3,), m."""
        return self.frame[:3, 3]

    @property
    def direction(self) -> FloatArray:
        """Unit vector along the joint axis, (3,)."""
        return self.frame[:3, :3] @ self.urdf.axis


class Tip(NamedTuple):
    """A link that becomes a tool, at position zero.

    Attributes:
        link: name of the link.
        joint: index of the joint that carries it.
        pose: pose of the link in the base link, (4, 4).
        beyond: links beyond it that could be the tool as well.
    """

    link: str
    joint: int
    pose: FloatArray
    beyond: tuple[str, ...]


@dataclass(frozen=True)
class MovingTree:
    """The moving joints of a robot at position zero, in the frame of its base link.

    Attributes:
        robot_name: name of the robot.
        base: name of the base link.
        shape: "chain" or "tree".
        up: direction of the root link's z axis, (3,).
        joints: joints that move, each after the one that carries it.
        tips: links of the end effectors.
        held_below: joints between root and base that could move.
        held_beside: other joints that could move.
        immobile: those of `held_beside` with several degrees of freedom, if all joints should move.
        followers: joints that follow moving ones, without mass.
    """

    robot_name: str
    base: str
    shape: str
    up: FloatArray
    joints: tuple[MovingJoint, ...]
    tips: tuple[Tip, ...]
    held_below: tuple[HeldJoint, ...]
    held_beside: tuple[HeldJoint, ...]
    immobile: tuple[UrdfJoint, ...]
    followers: tuple[UrdfJoint, ...]

    @property
    def held(self) -> tuple[HeldJoint, ...]:
        """All held joints, which could move and affect the robot."""
        return (*self.held_below, *self.held_beside)


def moving_tree(
    urdf: Urdf, base: str | None = None, tips: Sequence[str] = (), hold: Hold | None = None
) -> MovingTree:
    """Return the joints that move between a base link and tip links.

    Args:
        urdf: robot.
        base: name of the base link; the root by default.
        tips: names of the tip links; by default the end of each branch.
        hold: positions of joints that are held, by name; zero for others.

    Raises:
        InputError: there is no such path, joints on it have no drive, or joints cannot be held as requested.
    """
    hold = hold or {}
    moving = choose_moving_joints(urdf, base, tips, hold)
    carriers = _carriers_of_links(urdf, moving)
    carried = _links_by_carrier(urdf, carriers, len(moving.joints))
    below_base = [joint for joint in urdf.joints_above(moving.base) if not joint.is_fixed]
    side = _side_joints(urdf, carriers, moving)
    follow = {
        joint.name: urdf.relation_to_leader(joint, hold).leader in moving.names and is_massless(urdf, joint)
        for joint in side
    }
    beside = [joint for joint in side if not follow[joint.name]]
    _check_joints(urdf, moving, below_base, beside, hold)
    _check_links(urdf, carried)
    held = held_joints(urdf, [*below_base, *beside], moving, hold)
    poses = _link_poses(urdf, held)
    to_base = inverse_pose(poses[moving.base])
    return MovingTree(
        robot_name=urdf.name,
        base=moving.base,
        shape=moving.shape,
        up=to_base[:3, 2],
        joints=tuple(
            MovingJoint(
                joint,
                carriers[joint.parent],
                to_base @ poses[joint.child],
                links,
                _rigid_body_of(links, poses, to_base),
            )
            for joint, links in zip(moving.joints, carried, strict=True)
        ),
        tips=tuple(
            Tip(
                link,
                carriers[link],
                to_base @ poses[link],
                tuple(fixed_ends(urdf, link)) if moving.whole else (),
            )
            for link in moving.tips
        ),
        held_below=tuple(held[: len(below_base)]),
        held_beside=tuple(held[len(below_base) :]),
        immobile=tuple(joint for joint in beside if moving.whole and joint.type not in MOVING),
        followers=tuple(joint for joint in side if follow[joint.name]),
    )


def _check_joints(
    urdf: Urdf,
    moving: MovingJoints,
    below_base: Iterable[UrdfJoint],
    beside: Iterable[UrdfJoint],
    hold: Hold,
) -> None:
    """Raise an error for joints between base and tips without a drive, and for others that follow those."""
    problems = Problems(urdf.file)
    for joint in moving.joints:
        name = f"joint {quoted(joint.name)}"
        if joint.type not in MOVING:
            reason = f"is {joint.type}; a {moving.shape} has revolute, continuous and prismatic joints"
            problems.add(joint.line, f"{name} {reason}; choose base and tip so that it is not between them")
        if joint.mimic is not None:
            reason = f"follows {quoted(joint.mimic.leader)} (<mimic>), so it has no drive of its own"
            problems.add(joint.line, f"{name} {reason}; choose a tip before it")
    for place, joints in ((f"outside the {moving.shape}", beside), ("below the base", below_base)):
        for joint in joints:
            leader = urdf.relation_to_leader(joint, hold).leader
            if leader in moving.names:
                reason = f"{place} follows {quoted(leader)} on it (<mimic>)"
                fix = f"hold it by --hold {shlex.quote(joint.name)}=0, which neglects its motion"
                if moving.whole:
                    reason = f"follows {quoted(leader)} (<mimic>), so it has no drive of its own"
                    fix += f", or both by --hold {shlex.quote(leader)}=0"
                problems.add(joint.line, f"joint {quoted(joint.name)} {reason}; {fix}")
    problems.check()


def _check_links(urdf: Urdf, carried: Iterable[Iterable[UrdfLink]]) -> None:
    problems = Problems(urdf.file)
    for link in (link for links in carried for link in links):
        if link.flaw is not None:
            problems.add(*link.flaw)
    problems.check()


def _link_poses(urdf: Urdf, held: Iterable[HeldJoint]) -> dict[str, FloatArray]:
    """Return the pose of every link in the root, with some joints held and all others at zero."""
    positions = {each.urdf.name: each.position for each in held}
    poses = {urdf.root: np.eye(4)}
    for joint in joints_below(urdf.root, urdf.joints.values()):
        (motion,) = joint.motions(np.array([positions.get(joint.name, 0.0)]))
        poses[joint.child] = poses[joint.parent] @ joint.placement @ motion
    return poses


def _carriers_of_links(urdf: Urdf, moving: MovingJoints) -> dict[str, int]:
    """Return the index of the moving joint that carries each link from the base on; -1 for the base."""
    number = {name: index for index, name in enumerate(moving.names)}
    carriers = {moving.base: -1}
    for joint in joints_below(moving.base, urdf.joints.values()):
        carriers[joint.child] = number.get(joint.name, carriers[joint.parent])
    return carriers


def _links_by_carrier(urdf: Urdf, carriers: Mapping[str, int], count: int) -> list[tuple[UrdfLink, ...]]:
    """Return the links that each moving joint carries, its own first."""
    carried: list[list[UrdfLink]] = [[] for _ in range(count)]
    for link, index in carriers.items():
        if index >= 0:
            carried[index].append(urdf.links[link])
    return [tuple(links) for links in carried]


def _side_joints(urdf: Urdf, carriers: Mapping[str, int], moving: MovingJoints) -> list[UrdfJoint]:
    """Return joints that could move but do not, on links that move; of a whole robot, also on the base."""
    nearest = -1 if moving.whole else 0
    return [
        joint
        for joint in urdf.joints.values()
        if not joint.is_fixed and joint.name not in moving.names and carriers.get(joint.child, -2) >= nearest
    ]


def _rigid_body_of(
    links: tuple[UrdfLink, ...], poses: dict[str, FloatArray], to_base: FloatArray
) -> RigidBody:
    return weld_bodies(
        [link.body.in_outer_frame(to_base @ poses[link.name]) for link in links if link.body is not None]
    )
