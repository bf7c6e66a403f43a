"""Which joints lie between the base and the tip of a serial chain."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.documents.tree import quoted
from vsacli.robot.urdf.link_tree import Urdf, UrdfJoint, below

MAX_TIPS = 12
"""Links that a message offers as tip."""


class ChainPath(NamedTuple):
    """The joints from one link to another, fixed ones included."""

    base: str
    tip: str
    joints: tuple[UrdfJoint, ...]

    @property
    def moving(self) -> tuple[UrdfJoint, ...]:
        """Joints of the path that are not fixed."""
        return tuple(joint for joint in self.joints if not joint.is_fixed)


def find_path(urdf: Urdf, base: str | None, tip: str | None) -> ChainPath:
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
