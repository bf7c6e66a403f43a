"""Reading of URDF: links, joints, and gear ratios of transmissions.

All problems of a file are collected, each with its line; a faulty element is replaced by a harmless one, so
that reading continues.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from typing import TypeVar

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.units import POSITION, TORQUE, VELOCITY
from vsacli.documents.source import Problems, read_source
from vsacli.documents.tree import quoted
from vsacli.robot.plausibility.bodies import ROUNDED, turns
from vsacli.robot.urdf.link_tree import (
    LARGEST_NUMBER,
    MOVING,
    POSITION_LIMITS,
    TYPES,
    UNLIMITED,
    Mimic,
    RigidBody,
    Urdf,
    UrdfJoint,
    UrdfLimit,
    UrdfLink,
    joints_below,
    pose_matrix,
    quaternion_rotation,
    transform,
)
from vsacli.robot.urdf.vocabulary import REDUCTIONS, Unread, refuse_macros, sort_words
from vsacli.robot.urdf.xml_tree import Element, parse_xml

SIMPLE_TRANSMISSION = "SimpleTransmission"
"""Type of a transmission from one motor to one joint, in ROS control and for the PR2."""


def read_gear_ratios(root: Element, unread: Unread, problems: Problems) -> dict[str, float]:
    """Return the motion of the only motor over that of the joint, by the names of joints.

    Joints of other transmissions are noted as left out.
    """
    ratios: dict[str, float] = {}
    for transmission in _transmissions(root):
        joint_elements = (child for child in transmission.children if "joint" in child.tag.lower())
        joints = [
            joint_element.attributes["name"].strip()
            for joint_element in joint_elements
            if "name" in joint_element.attributes
        ]
        for name in dict.fromkeys(joints):
            if name not in unread.left_out:
                message = f"the transmission of joint {quoted(name)}, which does not exist, is ignored"
                unread.warn(transmission.line, message)
            elif name in ratios or len(joints) > 1 or not _is_simple(transmission):
                unread.left_out[name].append(("transmission that is not simple left out", ""))
            else:
                ratios[name] = _net_reduction(transmission, problems)
    return ratios


def _transmissions(root: Element) -> Iterator[Element]:
    yield from root.children_with_tag("transmission")
    for system in root.children_with_tag("ros2_control"):
        yield from system.children_with_tag("transmission")


def _is_simple(transmission: Element) -> bool:
    """Return whether a transmission is declared as simple, with one motor and one reduction at most."""
    types = [child.text for tag in ("type", "plugin") for child in transmission.children_with_tag(tag)]
    type_texts = [transmission.attributes.get("type", ""), *types]
    motors = list(transmission.children_with_tag("actuator"))
    has_one_motor = len(motors) == 1 >= len(_declared_reductions(transmission))
    return any(word.endswith(SIMPLE_TRANSMISSION) for word in type_texts) and has_one_motor


def _declared_reductions(transmission: Element) -> list[tuple[int, str, str]]:
    """Return line, word and text of each gear reduction, an element or an attribute."""
    parts = list(transmission.with_descendants())
    reduction_elements = [(part.line, part.tag, part.text) for part in parts if part.tag in REDUCTIONS]
    reduction_attributes = [
        (part.line, word, part.attributes[word])
        for part in parts
        for word in REDUCTIONS
        if word in part.attributes
    ]
    return reduction_elements + reduction_attributes


def _net_reduction(transmission: Element, problems: Problems) -> float:
    """Return the reduction of a simple transmission; 1 without one."""
    for line, word, text in _declared_reductions(transmission):
        try:
            ratio = float(text.replace("_", "?"))
        except ValueError:
            ratio = math.nan
        if 1 / LARGEST_NUMBER <= abs(ratio) <= LARGEST_NUMBER:
            return ratio
        problems.add(line, f"{word}: expected a number that is not zero, found {quoted(text)}")
    return 1.0


MAX_BYTES = 10_000_000
MAX_LINKS = 1000
VERSIONS = ("1.0", "1.1", "1.2")
"""Known versions of URDF; without an attribute, a file has the first. 1.1 adds quaternions."""

UNIT_QUATERNION = 1e-2
"""Deviation of a quaternion's norm from 1 that rounding to three digits cannot cause."""

_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_NamedRecord = TypeVar("_NamedRecord", UrdfLink, UrdfJoint)


def read_urdf(path: str | os.PathLike[str]) -> Urdf:
    """Read a URDF file.

    Raises:
        InputError: the file has problems; lists each with its line.
    """
    source, text = read_source(path, MAX_BYTES)
    problems = Problems(source.path)
    root = parse_xml(text, problems, "a URDF")
    if root.tag != "robot":
        problems.fail(root.line, f"expected a URDF, which begins with <robot>, found <{root.tag}>")
    refuse_macros(root, problems)
    for link in list(root.children_with_tag("link"))[MAX_LINKS:]:
        problems.fail(link.line, f"more than {MAX_LINKS:,} links")
    unread = Unread(source.path, root)
    sort_words(root, unread, problems)
    version = root.attributes.get("version", VERSIONS[0])
    if version not in VERSIONS:
        unread.warn(root.line, f"version {quoted(version)} is unknown; read as {VERSIONS[-1]}")
    reader = _ElementReader(problems, version, read_gear_ratios(root, unread, problems), unread)
    links = _index_by_name(map(reader.link, root.children_with_tag("link")), "link", problems)
    joints = _index_by_name(map(reader.joint, root.children_with_tag("joint")), "joint", problems)
    name = reader.word(root, "name")
    if not links:
        problems.fail(root.line, "the file describes no links")
    _check_joint_links(links, joints, problems)
    _check_mimic_circles(joints, problems)
    problems.check()
    root_link = _root_link(links, joints, problems)
    return Urdf(source.path, name, links, joints, root_link, tuple(sorted(unread.warnings())))


def _index_by_name(records: Iterable[_NamedRecord], kind: str, problems: Problems) -> dict[str, _NamedRecord]:
    records_by_name: dict[str, _NamedRecord] = {}
    for record in records:
        if record.name in records_by_name:
            line = records_by_name[record.name].line
            message = (
                f"the {kind} {quoted(record.name)} stands on line {line} already; each needs its own name"
            )
            problems.add(record.line, message)
        records_by_name.setdefault(record.name, record)
    return records_by_name


def _check_joint_links(
    links: Mapping[str, UrdfLink], joints: Mapping[str, UrdfJoint], problems: Problems
) -> None:
    """Check that each joint has two existing links, and no link two parents."""
    parents: dict[str, UrdfJoint] = {}
    for joint in joints.values():
        for link_name in dict.fromkeys((joint.parent, joint.child)):
            if link_name and link_name not in links:
                message = f"there is no link {quoted(link_name)}{did_you_mean(link_name, links)}"
                problems.add(joint.line, f"joint {quoted(joint.name)}: {message}")
        first_joint = parents.setdefault(joint.child, joint)
        if joint.child and first_joint is not joint:
            joints_text = f"the joints {quoted(first_joint.name)} and {quoted(joint.name)}"
            message = (
                f"the link {quoted(joint.child)} is the child of {joints_text}; closed loops are not read"
            )
            problems.add(joint.line, message)


def _check_mimic_circles(joints: Mapping[str, UrdfJoint], problems: Problems) -> None:
    for joint in joints.values():
        if joint.name in _followed_joints(joint, joints):
            message = "follows itself: the <mimic> of joints form a circle"
            problems.add(joint.line, f"joint {quoted(joint.name)} {message}")


def _followed_joints(joint: UrdfJoint, joints: Mapping[str, UrdfJoint]) -> set[str]:
    """Return the names of the joints that a joint follows, directly or indirectly."""
    leaders: set[str] = set()
    while joint.mimic is not None and joint.mimic.leader in joints.keys() - leaders:
        joint = joints[joint.mimic.leader]
        leaders.add(joint.name)
    return leaders


def _root_link(links: Mapping[str, UrdfLink], joints: Mapping[str, UrdfJoint], problems: Problems) -> str:
    """Return the name of the only link without a parent, and check that all others are below it."""
    children = {joint.child for joint in joints.values()}
    roots = [name for name in links if name not in children]
    if len(roots) != 1:
        reason = f"{', '.join(map(quoted, roots[:5]))} have no parent" if roots else "every link has a parent"
        problems.fail(1, f"the links must form one tree, which has one root, but {reason}")
    circular_links = (
        set(links) - {roots[0]} - {joint.child for joint in joints_below(roots[0], joints.values())}
    )
    if circular_links:
        names = sorted(circular_links, key=lambda name: links[name].line)
        message = f"the link {quoted(names[0])} is its own ancestor: the joints form a circle"
        problems.fail(links[names[0]].line, message)
    return roots[0]


class _ElementReader:
    """A reader of elements; problems are collected, and faulty parts replaced, so that reading continues."""

    def __init__(
        self, problems: Problems, version: str, gear_ratios: Mapping[str, float], unread: Unread
    ) -> None:
        self._problems, self._version = problems, version
        self._gear_ratios, self._unread = gear_ratios, unread

    def link(self, element: Element) -> UrdfLink:
        name = self.word(element, "name")
        inertial = self._child(element, "inertial")
        if inertial is None:
            return UrdfLink(name, element.line, None)
        mass, inertia = self._child(inertial, "mass"), self._child(inertial, "inertia")
        if mass is None or inertia is None:
            missing = "mass" if mass is None else "inertia"
            flaw = (inertial.line, f"inertial of {quoted(name)}: there is no <{missing}> in it")
            return UrdfLink(name, element.line, None, flaw)
        return UrdfLink(name, element.line, self._body(inertial, mass, inertia))

    def _body(self, inertial: Element, mass: Element, inertia: Element) -> RigidBody:
        xx, xy, xz, yy, yz, zz = (self._number(inertia, name) for name in _MOMENTS)
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return RigidBody(self._non_negative(mass, "value"), np.zeros(3), tensor).in_outer_frame(
            self._origin(inertial)
        )

    def joint(self, element: Element) -> UrdfJoint:
        name = self.word(element, "name")
        kind = self.word(element, "type", "fixed")
        if kind not in TYPES:
            self._problems.add(element.line, f"type: unknown word {quoted(kind)}{did_you_mean(kind, TYPES)}")
        dynamics, mimic = self._child(element, "dynamics"), self._child(element, "mimic")
        ratio = self._gear_ratios.get(name, 1.0)
        return UrdfJoint(
            name=name,
            line=element.line,
            type=kind,
            parent=self._link_name(element, "parent"),
            child=self._link_name(element, "child"),
            placement=self._origin(element),
            axis=self._axis(element) if kind in MOVING else np.zeros(3),
            limit=self._limit(element, kind),
            damping=0.0 if dynamics is None else self._non_negative(dynamics, "damping", 0.0),
            mimic=None if mimic is None else self._mimic(mimic),
            gear_ratio=None if ratio == 1 else ratio,
            left_out=tuple(self._unread.left_out.get(name, ())),
        )

    def _mimic(self, element: Element) -> Mimic:
        multiplier, offset = self._number(element, "multiplier", 1.0), self._number(element, "offset", 0.0)
        return Mimic(self.word(element, "joint"), multiplier, offset)

    def _link_name(self, joint: Element, tag: str) -> str:
        link_element = self._child(joint, tag)
        if link_element is None:
            self._problems.add(joint.line, f"joint: there is no <{tag}> in it")
            return ""
        return self.word(link_element, "link")

    def _axis(self, joint: Element) -> FloatArray:
        element = self._child(joint, "axis")
        axis = np.array((1.0, 0.0, 0.0) if element is None else self._vector(element, "xyz"))
        length = float(np.linalg.norm(axis))
        if element is not None and not length > 1 / LARGEST_NUMBER:
            self._problems.add(element.line, f"axis: {axis.tolist()} has no direction")
            return np.array([1.0, 0.0, 0.0])
        return axis / length

    def _limit(self, joint: Element, kind: str) -> UrdfLimit:
        element = self._child(joint, "limit")
        if element is None:
            return UrdfLimit()
        lower, upper, velocity, effort = (
            self._bound(element, name) for name in ("lower", "upper", "velocity", "effort")
        )
        self._note_dropped_limits(joint, element, kind, (lower, upper, velocity, effort))
        has_range = kind != "continuous" and lower < upper and (lower, upper) != UNLIMITED
        return UrdfLimit(
            position=(lower, upper) if has_range else None,
            velocity=velocity if 0 < velocity < LARGEST_NUMBER else None,
            effort=effort if 0 < effort < LARGEST_NUMBER else None,
        )

    def _note_dropped_limits(
        self, joint: Element, limit: Element, kind: str, values: tuple[float, float, float, float]
    ) -> None:
        """Note limits of the file that cannot be ones, with reason, value and line."""
        lower, upper, velocity, effort = values
        is_continuous, sign = kind == "continuous", "they are not positive"
        is_empty_range = (lower >= upper or is_continuous) and (lower, upper) != UNLIMITED
        reason = "the joint is continuous" if is_continuous else "lower is not below upper"
        for is_dropped, names, limits, cause, quantity in (
            (is_empty_range, ("lower", "upper"), POSITION_LIMITS, reason, POSITION),
            (velocity <= 0, ("velocity",), "velocity limits", sign, VELOCITY),
            (effort <= 0, ("effort",), "effort limits", sign, TORQUE),
        ):
            if is_dropped and not limit.attributes.keys().isdisjoint(names):
                value = " to ".join(limit.attributes.get(name, "0").strip() for name in names)
                unit = quantity.unit("prismatic" if kind == "prismatic" else "revolute")
                entry = (f"{limits} not taken over, since {cause}", f"{value} {unit} (line {limit.line})")
                self._unread.left_out[joint.attributes.get("name", "").strip()].append(entry)

    def _bound(self, element: Element, name: str) -> float:
        """Return a limit, clipped; files write infinite or very large ones for no limit."""
        return max(-LARGEST_NUMBER, min(LARGEST_NUMBER, self._number(element, name, 0.0, math.inf)))

    def _origin(self, element: Element) -> FloatArray:
        origin = self._child(element, "origin")
        if origin is None:
            return np.eye(4)
        xyz = self._vector(origin, "xyz")
        if "quat_xyzw" in origin.attributes:
            return transform(self._rotation(origin), np.array(xyz))
        rpy = self._vector(origin, "rpy")
        if large_angles := [angle for angle in rpy if turns(angle) >= 1 + ROUNDED]:
            angle = max(large_angles, key=abs)
            message = f"rpy: {angle:g} rad is {turns(angle):.3g} turns; did you mean {angle:g} deg?"
            self._unread.warn(origin.line, message, "turns")
        return pose_matrix(xyz, rpy)

    def _rotation(self, origin: Element) -> FloatArray:
        """Return the rotation of the quaternion of an origin, of any length but zero."""
        if self._version == VERSIONS[0]:
            fix = f'write version="{VERSIONS[1]}" in <robot>, or give rpy instead'
            self._problems.add(origin.line, f"quat_xyzw needs URDF {VERSIONS[1]}; {fix}")
        if "rpy" in origin.attributes:
            self._problems.add(origin.line, "rpy and quat_xyzw in one origin; remove one of them")
        quaternion = np.array(self._vector(origin, "quat_xyzw", 4))
        length = float(np.linalg.norm(quaternion))
        if not length > 1 / LARGEST_NUMBER:
            self._problems.add(origin.line, f"quat_xyzw: {quaternion.tolist()} has no direction")
            return np.eye(3)
        if abs(length - 1) > UNIT_QUATERNION:
            message = f"quat_xyzw has the length {length:.4g}, not 1; its direction is used"
            self._unread.warn(origin.line, message, "quaternions")
        return quaternion_rotation(quaternion / length)

    def _vector(self, element: Element, name: str, length: int = 3) -> list[float]:
        words = element.attributes.get(name, "0 0 0").split()
        numbers = [self._parse_number(element, name, word, LARGEST_NUMBER) for word in words]
        if len(numbers) != length:
            self._problems.add(element.line, f"{name}: expected {length} numbers, found {len(numbers)}")
            return [0.0] * (length - 1) + [float(length == 4)]
        return numbers

    def _non_negative(self, element: Element, name: str, default: float | None = None) -> float:
        number = self._number(element, name, default)
        if number < 0:
            self._problems.add(element.line, f"{element.tag}: must be zero or positive, not {number:g}")
        return abs(number)

    def _number(
        self, element: Element, name: str, default: float | None = None, largest: float = LARGEST_NUMBER
    ) -> float:
        if name in element.attributes:
            return self._parse_number(element, name, element.attributes[name], largest)
        if default is None:
            self._problems.add(element.line, f"{element.tag}: there is no attribute {name}")
        return default or 0.0

    def _parse_number(self, element: Element, name: str, word: str, largest: float) -> float:
        try:
            number = float(word.replace("_", "?"))
        except ValueError:
            number = math.nan
        if abs(number) <= largest:
            return number
        expected = "a number" if math.isinf(largest) else f"a number of at most {largest:g}"
        self._problems.add(element.line, f"{name}: expected {expected}, found {quoted(word)}")
        return 0.0

    def word(self, element: Element, name: str, default: str = "") -> str:
        """Return a required, printable attribute, for use in messages."""
        word = element.attributes.get(name, "").strip()
        if not word:
            self._problems.add(element.line, f"{element.tag}: there is no attribute {name}")
        elif not word.isprintable():
            self._problems.add(element.line, f"{name}: {quoted(word)} holds what cannot be printed")
        return word or default

    def _child(self, element: Element, tag: str) -> Element | None:
        """Return the only child with a tag; None without one."""
        children = list(element.children_with_tag(tag))
        if len(children) > 1:
            self._problems.add(children[1].line, f"{element.tag}: a second <{tag}>; one is expected")
        return children[0] if children else None
