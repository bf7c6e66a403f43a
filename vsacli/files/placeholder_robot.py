"""A robot in place of the unknown one of a trajectory, built from the joints in the trajectory."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.antagonistic import Antagonistic
from vsacli.actuators.damper import Damper
from vsacli.actuators.elastic import Elastic
from vsacli.actuators.laws.cubic import Cubic
from vsacli.actuators.motor import Motor
from vsacli.actuators.rigid import Rigid
from vsacli.base import units
from vsacli.base.signals import COMMANDED, WRENCH, WRENCHES
from vsacli.base.wrench import wrench_columns
from vsacli.documents import tree
from vsacli.documents.csv_file import read_header
from vsacli.documents.fields import IDENTIFIER, LARGEST
from vsacli.documents.reading import survey_document
from vsacli.documents.source import is_table
from vsacli.robot.joint import DenavitHartenberg, Inertia, Joint, Link, Tool
from vsacli.robot.model import Robot
from vsacli.trajectory.file import OF_ANY_ROBOT

MOST_JOINTS = 1000
NUMBERED = (1,)
"""Columns that need no name: a first line that begins with a number is not a header."""

_POSITION_SUFFIX, _STIFFNESS_SUFFIX, _DAMPING_SUFFIX = ".q", ".stiffness", ".damping"


class PlaceholderRobot(NamedTuple):
    """A robot in place of an unknown one.

    Attributes:
        robot: robot with the joints found in the trajectory.
        ordered: whether the joints are certain to be in the order of the lists in the trajectory.
    """

    robot: Robot
    ordered: bool


def placeholder_robot(path: str | os.PathLike[str]) -> PlaceholderRobot:
    """Return a robot of revolute joints that a valid trajectory fits.

    Names and number of joints are taken from the file; one joint if it has no information. Joints without
    stiffness are elastic, or rigid if the file has neither stiffness nor damping. Joints with a damping have
    a damper. Tools are those that `wrenches` or columns of wrenches name.

    Raises:
        InputError: the file, or a CSV file that it names, cannot be read.
    """
    if is_table(path):
        columns = read_header(path, NUMBERED).columns
        names = _joints_of_columns(columns) or _numbered_names(1)
        stiff_joints = _joints_with_suffix(columns, _STIFFNESS_SUFFIX, names) or tuple(names)
        damped_joints = _joints_with_suffix(columns, _DAMPING_SUFFIX, names)
        return PlaceholderRobot(
            _robot(names, stiff_joints, damped_joints, _tools_of_wrench_columns(columns)), ordered=True
        )
    root, survey = survey_document(path, OF_ANY_ROBOT)
    folder = Path(path).parent
    columns = tuple(
        column
        for file, mapped_columns in _csv_columns(root).items()
        for column in (*mapped_columns, *read_header(folder / file, NUMBERED).columns)
    )
    positions, stiffnesses, dampings = (
        [node for quantity, node in survey if quantity == quantity_wanted]
        for quantity_wanted in (units.POSITION, units.STIFFNESS, units.DAMPING)
    )
    names = _joints_of_columns(columns) or _joints_of_nodes(positions, [*stiffnesses, *dampings])
    stiff_joints, damped_joints = (
        _joints_with_signal(nodes, columns, suffix, names) if key in root.entries else ()
        for key, nodes, suffix in (
            ("stiffness", stiffnesses, _STIFFNESS_SUFFIX),
            ("damping", dampings, _DAMPING_SUFFIX),
        )
    )
    ordered = bool(columns or _mapping_keys(positions)) or not _mapping_keys([*stiffnesses, *dampings])
    wrenches = root.entries.get(WRENCHES)
    tools = _valid_names(
        (
            *(wrenches.entries if isinstance(wrenches, tree.MapNode) else ()),
            *_tools_of_wrench_columns(columns),
        )
    )
    return PlaceholderRobot(_robot(names, stiff_joints, damped_joints, tools), ordered)


def _csv_columns(root: tree.MapNode) -> dict[str, list[str]]:
    """Return the CSV files of a document, each with the column names mapped in the document."""
    files: dict[str, list[str]] = {}
    for key in ("position", *COMMANDED):
        match root.entries.get(key):
            case tree.MapNode(
                entries={"type": tree.TextNode(text="csv"), "file": tree.TextNode(text=file), **others}
            ):
                columns = others.get("columns")
                names = columns.entries if isinstance(columns, tree.MapNode) else ()
                files.setdefault(file, []).extend(names)
    return files


def _joints_of_columns(columns: Iterable[str]) -> tuple[str, ...]:
    """Return joint names by the columns of positions, `<joint>.q` or `q1`, with or without a unit."""
    names_without_unit = [column.partition("[")[0].strip() for column in columns]
    joint_names = _valid_names(
        column.removesuffix(_POSITION_SUFFIX)
        for column in names_without_unit
        if column.endswith(_POSITION_SUFFIX)
    )
    position_count = sum(1 for column in names_without_unit if column[:1] == "q" and column[1:].isdecimal())
    return joint_names or _numbered_names(position_count)


def _tools_of_wrench_columns(columns: Iterable[str]) -> tuple[str, ...]:
    """Return the tools that have a column of each component of a wrench, such as `hand.fx`."""
    names_without_unit = {column.partition("[")[0].strip(): None for column in columns}
    names = _valid_names(column.rpartition(".")[0] for column in names_without_unit)
    return tuple(
        name for name in names if names_without_unit.keys() >= {*wrench_columns(f"{name}.{WRENCH.key}")}
    )


def _joints_with_suffix(columns: Iterable[str], suffix: str, names: Sequence[str]) -> tuple[str, ...]:
    names_without_unit = {column.partition("[")[0].strip() for column in columns}
    return tuple(name for name in names if f"{name}{suffix}" in names_without_unit)


def _joints_of_nodes(positions: Sequence[tree.Node], other_nodes: Sequence[tree.Node]) -> tuple[str, ...]:
    """Return joint names by values per joint: keys of mappings, and as many as the longest list has entries.

    Further signals need not name all joints, but their lists have an entry for each joint.
    """
    joint_names = _mapping_keys(positions)
    if joint_names:
        return joint_names
    item_lists = (node.items for node in (*positions, *other_nodes) if isinstance(node, tree.ListNode))
    count = max(map(len, item_lists), default=1)
    joint_names = _mapping_keys(other_nodes)
    unused_names = (name for name in _numbered_names(count + len(joint_names)) if name not in joint_names)
    return (*joint_names, *islice(unused_names, max(count - len(joint_names), 0)))


def _mapping_keys(nodes: Sequence[tree.Node]) -> tuple[str, ...]:
    keys = [key for node in nodes if isinstance(node, tree.MapNode) for key in node.entries]
    return _valid_names(keys)


def _valid_names(words: Iterable[str]) -> tuple[str, ...]:
    """Return the words that are valid joint names, each once."""
    return tuple(dict.fromkeys(word for word in words if IDENTIFIER.fullmatch(word)))[:MOST_JOINTS]


def _numbered_names(count: int) -> tuple[str, ...]:
    return tuple(f"joint_{number}" for number in range(1, min(count, MOST_JOINTS) + 1))


def _joints_with_signal(
    nodes: Sequence[tree.Node], columns: Iterable[str], suffix: str, names: Sequence[str]
) -> tuple[str, ...]:
    """Return the joints that have a signal, by values per joint, or else by columns with this suffix."""
    if not nodes:
        return _joints_with_suffix(columns, suffix, names) or tuple(names)
    for node in nodes:
        match node:
            case tree.MapNode(entries=entries):
                return tuple(name for name in names if name in entries)
            case tree.ListNode(items=items) if len(items) == len(names):
                has_value = [not (isinstance(item, tree.TextNode) and item.is_null) for item in items]
                return tuple(name for name, is_present in zip(names, has_value, strict=True) if is_present)
    return tuple(names)


def _robot(
    names: Sequence[str], stiff_joints: Sequence[str], damped_joints: Sequence[str], tools: Sequence[str] = ()
) -> Robot:
    return Robot(
        name="stand-in",
        placeholder=True,
        tools=tuple(Tool(name=tool, joint=names[-1]) for tool in tools),
        joints=tuple(
            _joint(name, _actuator(name, stiff_joints, damped_joints), damped_joints) for name in names
        ),
    )


def _actuator(name: str, stiff_joints: Sequence[str], damped_joints: Sequence[str]) -> Actuator:
    motor = Motor(inertia=1.0)
    if not stiff_joints and not damped_joints:
        return Rigid(motor=motor)
    if name in stiff_joints:
        return Antagonistic(motor=(motor, motor), spring=(Cubic(k=1.0, k_c=1.0),) * 2)
    return Elastic(motor=motor, stiffness=1.0)


def _joint(name: str, actuator: Actuator, damped_joints: Sequence[str]) -> Joint:
    return Joint(
        name=name,
        type="revolute",
        dh=DenavitHartenberg(a=1.0, alpha=0.0),
        link=Link(mass=1.0, com=(0.0, 0.0, 0.0), inertia=Inertia(xx=1.0, yy=1.0, zz=1.0)),
        actuator=actuator,
        damper=Damper(location="link", range=(0.0, LARGEST)) if name in damped_joints else None,
    )
