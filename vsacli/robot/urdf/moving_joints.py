"""The joints of a URDF that move: all below a base that have a drive, or those between it and chosen tips."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.documents.tree import quoted
from vsacli.robot.urdf.link_tree import MOVING, Urdf, UrdfJoint, joints_below


class MovingJoints(NamedTuple):
    """The joints that move, and the links between which they are.

    Attributes:
        base: link that is fixed to the ground.
        tips: links of the end effectors.
        joints: joints, each after the one that carries it, branch by branch in the order of the file.
        whole: whether all joints below the base move that can, rather than those before chosen tips.
        shape: "chain" or "tree".
    """

    base: str
    tips: tuple[str, ...]
    joints: tuple[UrdfJoint, ...]
    whole: bool
    shape: str

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(joint.name for joint in self.joints)


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
    return MovingJoints(start, ends, joints, not chosen, "chain" if len(last) == 1 else "tree")


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

    Joints beyond one that follows such a joint are none: they move with a branch that is left out. Joints of
    several degrees of freedom are none on the base, where they are held; elsewhere they are, and refused.
    """
    below = list(joints_below(base, urdf.joints.values()))
    driven = {
        joint.name
        for joint in below
        if joint.type in MOVING and joint.mimic is None and joint.name not in held
    }
    left_out: set[str] = set()
    for joint in below:
        if joint.name not in driven and urdf.relation_to_leader(joint, held).leader in driven:
            left_out.update(further.name for further in joints_below(joint.child, below))
    refused = {
        joint.name
        for joint in below
        if not (joint.is_fixed or joint.type in MOVING)
        and any(above.name in driven for above in urdf.joints_above(joint.parent))
    }
    return (driven | refused) - left_out


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
    while len(fixed := fixed_links(urdf, link)) == 1:
        (link,) = fixed
    return link


def fixed_links(urdf: Urdf, link: str) -> list[str]:
    """Return the links that fixed joints connect to their parent link."""
    return [joint.child for joint in urdf.joints.values() if joint.parent == link and joint.is_fixed]


def fixed_ends(urdf: Urdf, link: str) -> list[str]:
    """Return the last links of the branches of fixed joints on a link; none without branches."""
    fixed: Iterable[UrdfJoint] = [joint for joint in urdf.joints.values() if joint.is_fixed]
    links = [joint.child for joint in joints_below(link, fixed)]
    return [each for each in links if not fixed_links(urdf, each)]
