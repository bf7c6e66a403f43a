"""Reading of URDF: links and joints, and extensions by vendors (transmissions, safety controllers).

All problems of a file are collected, each with its line; a faulty element is replaced by a harmless one, so
that reading continues.
"""

from __future__ import annotations

import math
import os
import re
import shlex
from collections.abc import Iterable, Iterator, Mapping
from pathlib import PurePath
from typing import NamedTuple, TypeVar

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.documents.source import Problems, read_source
from vsacli.documents.tree import quoted
from vsacli.robot.urdf.link_tree import (
    LARGEST_NUMBER,
    MOVING,
    TYPES,
    Body,
    Mimic,
    Urdf,
    UrdfJoint,
    UrdfLimit,
    UrdfLink,
    below,
    pose_matrix,
)
from vsacli.robot.urdf.xml_tree import Element, parse_xml

SIMPLE = "SimpleTransmission"
"""Type of a transmission from one motor to one joint, in ROS control and for the PR2."""

REDUCTIONS = ("mechanicalReduction", "mechanical_reduction")
"""Tags of a gear reduction in ROS control and in ros2_control."""

SPRINGS = ("springStiffness", "springReference")


class Beside(NamedTuple):
    """Data on joints outside of their elements, by the names of joints.

    Attributes:
        gear_ratios: motion of the only motor over that of the joint.
        left_out: short phrases on properties that a robot file cannot express.
    """

    gear_ratios: Mapping[str, float]
    left_out: Mapping[str, list[str]]


def read_beside(root: Element, problems: Problems) -> Beside:
    """Read the transmissions of a robot, and the springs of its joints."""
    gear_ratios: dict[str, float] = {}
    left_out: dict[str, list[str]] = {}
    for transmission in _transmissions(root):
        joints = [child for child in transmission.children if "joint" in child.tag.lower()]
        for name in dict.fromkeys(joint.attributes.get("name", "").strip() for joint in joints):
            if name in gear_ratios or len(joints) > 1 or not _is_simple(transmission):
                left_out.setdefault(name, []).append("transmission that is not simple")
            else:
                gear_ratios[name] = _reduction(transmission, problems)
    for gazebo in root.all("gazebo"):
        if any(child.tag in SPRINGS for child in gazebo.children):
            name = gazebo.attributes.get("reference", "").strip()
            left_out.setdefault(name, []).append(f"spring parallel to the drive (<{SPRINGS[0]}>)")
    return Beside(gear_ratios, left_out)


def _transmissions(root: Element) -> Iterator[Element]:
    yield from root.all("transmission")
    for system in root.all("ros2_control"):
        yield from system.all("transmission")


def _is_simple(transmission: Element) -> bool:
    """Return whether a transmission is declared as simple, with one motor and one reduction at most."""
    types = [child.text for tag in ("type", "plugin") for child in transmission.all(tag)]
    says_so = [transmission.attributes.get("type", ""), *types]
    motors = list(transmission.all("actuator"))
    return any(word.endswith(SIMPLE) for word in says_so) and len(motors) == 1 >= len(_found(transmission))


def _found(transmission: Element) -> list[Element]:
    return [element for element in transmission.everything() if element.tag in REDUCTIONS]


def _reduction(transmission: Element, problems: Problems) -> float:
    """Return the reduction of a simple transmission; 1 without one."""
    for element in _found(transmission):
        try:
            ratio = float(element.text.replace("_", "?"))
        except ValueError:
            ratio = math.nan
        if 1 / LARGEST_NUMBER <= abs(ratio) <= LARGEST_NUMBER:
            return ratio
        expected = "expected a number that is not zero"
        problems.add(element.line, f"{element.tag}: {expected}, found {quoted(element.text)}")
    return 1.0


MACRO = re.compile(r"\$\{|\$\((anon|arg|dirname|env|eval|find|optenv)\b")
"""Beginning of an xacro expression; names may contain other dollar signs."""

MESH = "filename"
"""Attribute that names a mesh, which is never opened."""

MAX_BYTES = 10_000_000
MAX_LINKS = 1000
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_Named = TypeVar("_Named", UrdfLink, UrdfJoint)


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
    _refuse_macros(root, problems)
    for link in list(root.all("link"))[MAX_LINKS:]:
        problems.fail(link.line, f"more than {MAX_LINKS:,} links")
    reader = _Reader(problems, read_beside(root, problems))
    links = _by_name(map(reader.link, root.all("link")), "link", problems)
    joints = _by_name(map(reader.joint, root.all("joint")), "joint", problems)
    name = reader.word(root, "name")
    if not links:
        problems.fail(root.line, "the file describes no links")
    _check_ends(links, joints, problems)
    _check_leaders(joints, problems)
    problems.check()
    return Urdf(source.path, name, links, joints, _root(links, joints, problems))


def _refuse_macros(root: Element, problems: Problems) -> None:
    """Report tags and expressions of xacro; its namespace is allowed, since expanded files keep it."""
    for element in root.everything():
        macros = [f"<{quoted(element.tag)[1:-1]}>"] if element.tag.startswith("xacro:") else []
        values = (word for name, word in element.attributes.items() if name != MESH)
        macros += [quoted(word) for word in values if MACRO.search(word)]
        for macro in macros:
            name = PurePath(problems.file).name
            stem = name.split(".")[0]
            urdf = f"{stem}.urdf" if name != f"{stem}.urdf" else f"{stem}_expanded.urdf"
            how = f"expand it first: xacro {shlex.quote(problems.file)} > {shlex.quote(urdf)}"
            problems.fail(element.line, f"{macro} belongs to a xacro file; {how}")


def _by_name(records: Iterable[_Named], kind: str, problems: Problems) -> dict[str, _Named]:
    named: dict[str, _Named] = {}
    for record in records:
        if record.name in named:
            first = named[record.name].line
            message = (
                f"the {kind} {quoted(record.name)} stands on line {first} already; each needs its own name"
            )
            problems.add(record.line, message)
        named.setdefault(record.name, record)
    return named


def _check_ends(links: Mapping[str, UrdfLink], joints: Mapping[str, UrdfJoint], problems: Problems) -> None:
    """Check that each joint has two existing links, and no link two parents."""
    parents: dict[str, UrdfJoint] = {}
    for joint in joints.values():
        for end in dict.fromkeys((joint.parent, joint.child)):
            if end and end not in links:
                message = f"there is no link {quoted(end)}{did_you_mean(end, links)}"
                problems.add(joint.line, f"joint {quoted(joint.name)}: {message}")
        other = parents.setdefault(joint.child, joint)
        if joint.child and other is not joint:
            both = f"the joints {quoted(other.name)} and {quoted(joint.name)}"
            message = f"the link {quoted(joint.child)} is the child of {both}; closed loops are not read"
            problems.add(joint.line, message)


def _check_leaders(joints: Mapping[str, UrdfJoint], problems: Problems) -> None:
    for joint in joints.values():
        if joint.name in _leaders(joint, joints):
            message = "follows itself: the <mimic> of joints form a circle"
            problems.add(joint.line, f"joint {quoted(joint.name)} {message}")


def _leaders(joint: UrdfJoint, joints: Mapping[str, UrdfJoint]) -> set[str]:
    """Return the names of the joints that a joint follows, directly or indirectly."""
    leaders: set[str] = set()
    while joint.mimic is not None and joint.mimic.leader in joints.keys() - leaders:
        joint = joints[joint.mimic.leader]
        leaders.add(joint.name)
    return leaders


def _root(links: Mapping[str, UrdfLink], joints: Mapping[str, UrdfJoint], problems: Problems) -> str:
    """Return the name of the only link without a parent, and check that all others are below it."""
    children = {joint.child for joint in joints.values()}
    roots = [name for name in links if name not in children]
    if len(roots) != 1:
        found = f"{', '.join(map(quoted, roots[:5]))} have no parent" if roots else "every link has a parent"
        problems.fail(1, f"the links must form one tree, which has one root, but {found}")
    circles = set(links) - {roots[0]} - {joint.child for joint in below(roots[0], joints.values())}
    if circles:
        names = sorted(circles, key=lambda name: links[name].line)
        message = f"the link {quoted(names[0])} is its own ancestor: the joints form a circle"
        problems.fail(links[names[0]].line, message)
    return roots[0]


class _Reader:
    """A reader of elements; problems are collected, and faulty parts replaced, so that reading continues."""

    def __init__(self, problems: Problems, beside: Beside) -> None:
        self._problems = problems
        self._beside = beside

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

    def _body(self, inertial: Element, mass: Element, inertia: Element) -> Body:
        xx, xy, xz, yy, yz, zz = (self._number(inertia, name) for name in _MOMENTS)
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return Body(self._non_negative(mass, "value"), np.zeros(3), tensor).moved(self._origin(inertial))

    def joint(self, element: Element) -> UrdfJoint:
        name = self.word(element, "name")
        kind = self.word(element, "type", "fixed")
        if kind not in TYPES:
            self._problems.add(element.line, f"type: unknown word {quoted(kind)}{did_you_mean(kind, TYPES)}")
        dynamics, mimic = self._child(element, "dynamics"), self._child(element, "mimic")
        ratio = self._beside.gear_ratios.get(name, 1.0)
        return UrdfJoint(
            name=name,
            line=element.line,
            type=kind,
            parent=self._end(element, "parent"),
            child=self._end(element, "child"),
            placement=self._origin(element),
            axis=self._axis(element) if kind in MOVING else np.zeros(3),
            limit=self._limit(element, kind),
            damping=0.0 if dynamics is None else self._non_negative(dynamics, "damping", 0.0),
            mimic=None if mimic is None else self._mimic(mimic),
            gear_ratio=None if ratio == 1 else ratio,
            left_out=(*self._left_out(element), *self._beside.left_out.get(name, ())),
        )

    def _left_out(self, joint: Element) -> Iterator[str]:
        """Yield phrases on parts that a robot file cannot express, or that are ambiguous in the URDF."""
        for dynamics in joint.all("dynamics"):
            if self._non_negative(dynamics, "friction", 0.0):
                yield "dry friction"
            others = [name for name in dynamics.attributes if name not in ("damping", "friction")]
            if others:
                yield f"{', '.join(others)} of <dynamics>"
        for safety in joint.all("safety_controller"):
            if any(name.startswith("soft_") for name in safety.attributes):
                yield "soft limits (<safety_controller>)"
        if any(joint.all("calibration")):
            yield "reference position (<calibration>)"

    def _mimic(self, element: Element) -> Mimic:
        multiplier, offset = self._number(element, "multiplier", 1.0), self._number(element, "offset", 0.0)
        return Mimic(self.word(element, "joint"), multiplier, offset)

    def _end(self, joint: Element, tag: str) -> str:
        end = self._child(joint, tag)
        if end is None:
            self._problems.add(joint.line, f"joint: there is no <{tag}> in it")
            return ""
        return self.word(end, "link")

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
        lower, upper = (self._bound(element, name) for name in ("lower", "upper"))
        velocity, effort = (self._bound(element, name) for name in ("velocity", "effort"))
        bounds = (
            kind != "continuous" and lower < upper and (lower, upper) != (-LARGEST_NUMBER, LARGEST_NUMBER)
        )
        return UrdfLimit(
            position=(lower, upper) if bounds else None,
            velocity=velocity if 0 < velocity < LARGEST_NUMBER else None,
            effort=effort if 0 < effort < LARGEST_NUMBER else None,
        )

    def _bound(self, element: Element, name: str) -> float:
        """Return a limit, clipped; files write infinite or very large ones for no limit."""
        return max(-LARGEST_NUMBER, min(LARGEST_NUMBER, self._float(element, name, 0.0, math.inf)))

    def _origin(self, element: Element) -> FloatArray:
        origin = self._child(element, "origin")
        if origin is None:
            return np.eye(4)
        return pose_matrix(self._vector(origin, "xyz"), self._vector(origin, "rpy"))

    def _vector(self, element: Element, name: str) -> list[float]:
        words = element.attributes.get(name, "0 0 0").split()
        numbers = [self._parsed(element, name, word, LARGEST_NUMBER) for word in words]
        if len(numbers) != 3:
            self._problems.add(element.line, f"{name}: expected 3 numbers, found {len(numbers)}")
            return [0.0, 0.0, 0.0]
        return numbers

    def _number(self, element: Element, name: str, default: float | None = None) -> float:
        return self._float(element, name, default, LARGEST_NUMBER)

    def _non_negative(self, element: Element, name: str, default: float | None = None) -> float:
        number = self._number(element, name, default)
        if number < 0:
            self._problems.add(element.line, f"{element.tag}: must be zero or positive, not {number:g}")
        return abs(number)

    def _float(self, element: Element, name: str, default: float | None, largest: float) -> float:
        if name in element.attributes:
            return self._parsed(element, name, element.attributes[name], largest)
        if default is None:
            self._problems.add(element.line, f"{element.tag}: there is no attribute {name}")
        return default or 0.0

    def _parsed(self, element: Element, name: str, word: str, largest: float) -> float:
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
        found = list(element.all(tag))
        if len(found) > 1:
            self._problems.add(found[1].line, f"{element.tag}: a second <{tag}>; one is expected")
        return found[0] if found else None
