"""Groups of joints in an SRDF, the file of MoveIt: base link and tip links of a group.

The format: https://docs.ros.org/en/api/srdfdom/html/structsrdf_1_1Model_1_1Group.html
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from vsacli.base.did_you_mean import did_you_mean
from vsacli.documents.source import Problems, read_source
from vsacli.documents.tree import quoted
from vsacli.robot.urdf.link_tree import Urdf, UrdfJoint
from vsacli.robot.urdf.xml_tree import Element, parse_xml

MAX_BYTES = 10_000_000
"""Largest file, as for a URDF; most of an SRDF are pairs of links that may collide."""


class GroupEnds(NamedTuple):
    """The base link and the tip links of a group."""

    base: str
    tips: tuple[str, ...]


def ends_of_group(path: str | os.PathLike[str], group: str | None, urdf: Urdf) -> GroupEnds:
    """Return the base link and the tip links of a group.

    Args:
        path: path of the SRDF file.
        group: name of the group; None for the only one.
        urdf: robot.

    Raises:
        InputError: the file is not an SRDF, or the group does not exist, or leaves out joints between others.
    """
    source, text = read_source(path, MAX_BYTES)
    problems = Problems(source.path)
    root = parse_xml(text, problems, "an SRDF")
    if root.tag != "robot" or any(root.children_with_tag("link")):
        problems.fail(root.line, "expected an SRDF, in whose <robot> there are groups and no links")
    groups = {element.attributes.get("name", ""): element for element in root.children_with_tag("group")}
    if not groups:
        problems.fail(root.line, "there is no <group> in it")
    if group is None and len(groups) > 1:
        problems.fail(root.line, f"choose one of its groups with --group: {', '.join(map(quoted, groups))}")
    name = next(iter(groups)) if group is None else group
    if name not in groups:
        problems.fail(root.line, f"there is no group {quoted(name)}{did_you_mean(name, groups)}")
    return _Groups(groups, urdf, problems).ends(name)


class _Groups:
    """The groups of a file, resolved on a robot."""

    def __init__(self, groups: Mapping[str, Element], urdf: Urdf, problems: Problems) -> None:
        self._groups, self._urdf, self._problems = groups, urdf, problems

    def ends(self, name: str) -> GroupEnds:
        group = self._groups[name]
        joints = self._joints(name, ())
        moving = [joint for joint in joints.values() if not joint.is_fixed]
        if not moving:
            self._problems.fail(group.line, f"no joint moves in the group {quoted(name)}")
        paths = {joint.child: self._urdf.joints_above(joint.child) for joint in joints.values()}
        inner = {above.name for joint in moving for above in self._urdf.joints_above(joint.parent)}
        tips = [
            max((link for link, path in paths.items() if joint in path), key=lambda link: len(paths[link]))
            for joint in moving
            if joint.name not in inner
        ]
        base = self._common_base(group, [paths[tip] for tip in tips], moving)
        above = self._urdf.joints_above(base)
        between = {joint.name: joint for tip in tips for joint in paths[tip] if joint not in above}
        missing = [joint for joint in between.values() if not joint.is_fixed and joint not in moving]
        if missing:
            names = ", ".join(quoted(joint.name) for joint in missing)
            shape = "chain" if len(tips) == 1 else "tree"
            self._problems.fail(group.line, f"the group {quoted(name)} leaves out {names} within its {shape}")
        return GroupEnds(base, tuple(tips))

    def _common_base(
        self, group: Element, paths: Sequence[Sequence[UrdfJoint]], moving: Sequence[UrdfJoint]
    ) -> str:
        """Return the base link that the chains of the group share, or else the last before all that moves.

        A base link beyond a joint of the group that moves is that of one chain on another.
        """
        stated = {chain.attributes["base_link"] for chain in group.children_with_tag("chain")}
        if len(stated) == 1 and not any(joint in moving for joint in self._urdf.joints_above(*stated)):
            return stated.pop()
        before = [itertools.takewhile(lambda joint: joint not in moving, path) for path in paths]
        base = self._urdf.root
        for joint, *others in zip(*before, strict=False):
            if any(other is not joint for other in others):
                break
            base = joint.child
        return base

    def _joints(self, name: str, around: tuple[str, ...]) -> dict[str, UrdfJoint]:
        """Return the joints of a group by name: its own, and those of its links, chains and groups."""
        group = self._groups[name]
        if name in around:
            self._problems.fail(group.line, f"the group {quoted(name)} contains itself")
        named = [
            self._check_name(element, "name", "joint", self._urdf.joints)
            for element in group.children_with_tag("joint")
        ]
        joints = [self._urdf.joints[joint] for joint in named]
        for element in group.children_with_tag("link"):
            joints += self._urdf.joints_above(self._link(element, "name"))[-1:]
        for element in group.children_with_tag("chain"):
            joints += self._chain(element)
        by_name = {joint.name: joint for joint in joints}
        for element in group.children_with_tag("group"):
            inner = element.attributes.get("name", "")
            if inner not in self._groups:
                self._problems.fail(element.line, f"there is no group {quoted(inner)}")
            by_name |= self._joints(inner, (*around, name))
        return by_name

    def _check_name(self, element: Element, attribute: str, kind: str, names: Collection[str]) -> str:
        """Return the name of a link or joint of the robot in an attribute of an element."""
        name = element.attributes.get(attribute, "")
        if name not in names:
            near = did_you_mean(name, names)
            self._problems.fail(element.line, f"{self._urdf.file} has no {kind} {quoted(name)}{near}")
        return name

    def _link(self, element: Element, attribute: str) -> str:
        return self._check_name(element, attribute, "link", self._urdf.links)

    def _chain(self, element: Element) -> list[UrdfJoint]:
        base, tip = self._link(element, "base_link"), self._link(element, "tip_link")
        path = self._urdf.joints_above(tip)
        start = [number for number, joint in enumerate(path) if joint.parent == base]
        if not start:
            self._problems.fail(element.line, f"the link {quoted(tip)} does not hang below {quoted(base)}")
        return path[start[0] :]
