"""What a URDF says of its joints in elements beside them: gears, and springs of the Gazebo simulator."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from vsacli.documents.source import Problems
from vsacli.documents.tree import quoted
from vsacli.robot.urdf.link_tree import LARGEST_NUMBER
from vsacli.robot.urdf.xml_tree import Element

SIMPLE = "SimpleTransmission"
"""A transmission of one motor to one joint, as ROS control and the PR2 name it."""

REDUCTIONS = ("mechanicalReduction", "mechanical_reduction")
"""Tags of ROS control and of ros2_control."""

SPRINGS = ("springStiffness", "springReference")


class Beside(NamedTuple):
    """What is said beside joints, by their names.

    Attributes:
        gear_ratios: motion of the only motor over that of the joint.
        left_out: what a robot file does not hold, a few words each.
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
            left_out.setdefault(name, []).append(f"spring beside the drive (<{SPRINGS[0]}>)")
    return Beside(gear_ratios, left_out)


def _transmissions(root: Element) -> Iterator[Element]:
    yield from root.all("transmission")
    for system in root.all("ros2_control"):
        yield from system.all("transmission")


def _is_simple(transmission: Element) -> bool:
    """Whether it says to be of that type, of one motor, with one reduction at most."""
    types = [child.text for tag in ("type", "plugin") for child in transmission.all(tag)]
    says_so = [transmission.attributes.get("type", ""), *types]
    motors = list(transmission.all("actuator"))
    return any(word.endswith(SIMPLE) for word in says_so) and len(motors) == 1 >= len(_found(transmission))


def _found(transmission: Element) -> list[Element]:
    return [element for element in transmission.everything() if element.tag in REDUCTIONS]


def _reduction(transmission: Element, problems: Problems) -> float:
    """The reduction of a simple transmission, 1 if it has none."""
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
