"""Common parts of exported models: the result, writing of XML, and shapes of the links."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple, TypeAlias
from xml.etree import ElementTree

from vsacli.robot.joint import Joint, Pose
from vsacli.robot.model import Robot

Element: TypeAlias = ElementTree.Element
Value: TypeAlias = str | bool | float | Iterable[float]


def add_element(parent: Element, tag: str, /, **attributes: Value) -> Element:
    """Add a new element to another one, and return it."""
    return set_attributes(ElementTree.SubElement(parent, tag), **attributes)


def set_attributes(to: Element, /, **attributes: Value) -> Element:
    """Add or replace attributes of an element, and return it."""
    to.attrib.update({name: _format_attribute(value) for name, value in attributes.items()})
    return to


def xml_document(root: Element, comment: str) -> str:
    """Return the text of an XML file, indented, with a comment at its beginning."""
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<!-- {_without_double_hyphens(comment)} -->\n{text}\n'


def _format_attribute(value: Value) -> str:
    """Return numbers as the shortest text that reads back bit for bit; zero without a sign."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float | int):
        return repr(float(value) or 0.0).removesuffix(".0")
    return " ".join(map(_format_attribute, value))


def _without_double_hyphens(comment: str) -> str:
    """Return a comment without double hyphens, which would end it."""
    while "--" in comment:
        comment = comment.replace("--", "- -")
    return comment


THICKNESS_SHARE = 0.07
"""Radius of a drawn rod as a share of the mean length of links."""

WITHOUT_LENGTH = 0.5
"""Length, m, of an arm whose frame origins all coincide."""

TOOL = "tool"
"""Name of the tool of a robot without `tools`."""


def arm_length(robot: Robot) -> float:
    """Return the largest sum of distances from origin to origin between base and tip at q = 0, m."""
    return math.fsum(_longest_path(robot)) or WITHOUT_LENGTH


def rod_radius(robot: Robot) -> float:
    """Return the radius of the rods from origin to origin, m."""
    return THICKNESS_SHARE * arm_length(robot) / len(_longest_path(robot))


def _longest_path(robot: Robot) -> list[float]:
    """Return the distances from origin to origin, over mounts, along the longest path to a tip, m."""
    paths = ([_joint_length(robot.joints[index]) for index in robot.paths[tip]] for tip in robot.tips)
    return max(paths, key=math.fsum)


def _joint_length(joint: Joint) -> float:
    mount = Pose() if joint.mount is None else joint.mount
    return math.hypot(*mount.xyz) + math.hypot(joint.dh.a, joint.dh.d)


def exported_tool_names(robot: Robot) -> tuple[str, ...]:
    """Return the names of `end_effectors` in other programs."""
    return robot.tool_names if robot.tools else (TOOL,) * len(robot.end_effectors)


class ExportedModel(NamedTuple):
    """A robot in the file format of another program.

    Attributes:
        text: text of the model file.
        forces: text of a Python file with the forces that the format cannot express; None if there are none.
        notes: sentences on parts that are left out.
    """

    text: str
    forces: str | None
    notes: tuple[str, ...]
