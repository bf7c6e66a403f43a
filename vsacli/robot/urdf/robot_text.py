"""The text of a robot file for a converted robot, with comments on the placeholders to replace."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from vsacli.base import file_formats
from vsacli.base.texts import for_yaml
from vsacli.base.units import TORQUE
from vsacli.documents.fields import (
    Interval,
    NumberList,
    NumberWithUnit,
    OneOf,
    PairOf,
    RecordOf,
    TablePath,
    ValueKind,
    WordChoice,
    declared_fields,
)
from vsacli.robot.joint import FRAME_0, UNBOUNDED, DenavitHartenberg, Limits, Link, Pose
from vsacli.robot.model import Robot
from vsacli.robot.urdf.conversion import Conversion
from vsacli.robot.urdf.link_tree import UrdfJoint

COMMENT_COLUMN = 34
MAX_LINKS = 4
"""Most links that a comment names before it counts the rest."""


def converted_robot_text(conversion: Conversion) -> str:
    """Return the text of the robot file; `load_robot` returns the same robot from it."""
    robot = conversion.robot
    lines = [
        "# From a URDF, by vsacli import-urdf: frames, masses, inertias, damping and limits of the joints.",
        "# A URDF says nothing about motors and springs: replace what is marked as placeholder, then remove",
        "# `placeholder: true`.",
        f"format: {file_formats.ROBOT}",
        f"name: {for_yaml(robot.name)}",
        f"description: {for_yaml(robot.description)}",
        "placeholder: true",
        _append_comment(
            f"gravity: {_format_numbers(robot.gravity)}", "# m/s^2, in the axes of the base link"
        ),
        _append_comment(f"base: {_format_pose(robot.base)}", "# DH frame 0 in the base link; m, rad"),
        *_tool_lines(robot),
        "joints:",
    ]
    for index in range(len(robot.joints)):
        lines += _joint_lines(conversion, index)
    return "\n".join([*lines, ""])


def _tool_lines(robot: Robot) -> Iterator[str]:
    if not robot.tools:
        yield _append_comment(f"tool: {_format_pose(robot.tool)}", "# tip link in the last DH frame")
        return
    yield _append_comment("tools:", "# tip links in the DH frames of the links that carry them; m, rad")
    for tool in robot.tools:
        yield f"  {tool.name}: {{joint: {tool.joint}, {_format_pose(tool)[1:]}"


def _joint_lines(conversion: Conversion, index: int) -> Iterator[str]:
    joint, origin = conversion.robot.joints[index], conversion.tree.joints[index]
    renamed = "" if origin.urdf.name == joint.name else f"# {json.dumps(origin.urdf.name)} in the URDF"
    yield _append_comment(f"  - name: {joint.name}", renamed)
    yield f"    type: {joint.type}"
    if joint.parent is not None:
        yield f"    parent: {'null' if joint.parent == FRAME_0 else joint.parent}"
    if joint.mount is not None:
        carrying = conversion.robot.joint_names[origin.parent] if origin.parent >= 0 else "the base"
        comment = f"# where its row begins in the DH frame of {carrying}; m, rad"
        yield _append_comment(f"    mount: {_format_pose(joint.mount)}", comment)
    yield f"    dh: {_format_dh_row(joint.dh)}"
    yield _append_comment("    link:", _links_comment([link.name for link in origin.links]))
    yield from _link_lines(joint.link)
    if joint.damping:
        yield f"    damping: {_format_number(joint.damping)}"
    yield "    actuator:"
    yield f"      type: {joint.actuator_type}"
    for name, text in _format_fields(joint.actuator).items():
        comment = f"# {_origin_of(name, conversion, index)}"
        yield _append_comment(f"      {name}: {text}", comment)
    if joint.damper is not None:
        yield f"    damper: {_format_mapping(_format_fields(joint.damper))}"
    if joint.limits != Limits():
        yield _append_comment(f"    limits: {_format_limits(joint.limits)}", "# of the joint's motion")


def _links_comment(names: list[str]) -> str:
    shown = ", ".join(map(json.dumps, names[:MAX_LINKS]))
    return f"# {shown}" + (f" and {len(names) - MAX_LINKS} more" if len(names) > MAX_LINKS else "")


def _format_dh_row(dh: DenavitHartenberg) -> str:
    return (
        f"{{a: {_format_number(dh.a)}, alpha: {_format_angle(dh.alpha)}, "
        f"d: {_format_number(dh.d)}, theta: {_format_angle(dh.theta)}}}"
    )


def _link_lines(link: Link) -> Iterator[str]:
    entries = (
        f"{name}: {_format_number(getattr(link.inertia, name))}"
        for name in ("xx", "yy", "zz", "xy", "xz", "yz")
    )
    yield f"      mass: {_format_number(link.mass)}"
    yield f"      com: {_format_numbers(link.com)}"
    yield f"      inertia: {{{', '.join(entries)}}}"


def _origin_of(field: str, conversion: Conversion, index: int) -> str:
    """Return the origin of the numbers in a field of an actuator, with motor data of the URDF."""
    joint, load = conversion.tree.joints[index], conversion.loads[index]
    converted = conversion.robot.joints[index]
    if device := conversion.devices.get(converted.name):
        return f"of the device {device}"
    origin = f"placeholder: {conversion.placeholders.origin(field, joint, load)}"
    motor_data = " and ".join(_describe_urdf_motor(joint.urdf))
    if field != "motor" or not motor_data:
        return origin
    return f"{origin}; {'with' if converted.actuator.motor_count == 1 else 'the URDF has'} {motor_data}"


def _describe_urdf_motor(joint: UrdfJoint) -> Iterator[str]:
    if joint.limit.effort:
        yield f"an effort limit of {_format_number(joint.limit.effort)} {joint.unit(TORQUE)} (joint side)"
    if joint.gear_ratio:
        yield f"a gear reduction of {_format_number(joint.gear_ratio)}"


def _format_fields(record: Any) -> dict[str, str]:
    """Return the text of each field of a record, without fields at their default."""
    values = {name: getattr(record, name) for name in declared_fields(type(record))}
    return {
        name: _format_field(field.kind, values[name])
        for name, (field, default) in declared_fields(type(record)).items()
        if values[name] != default
    }


def _format_field(kind: ValueKind, content: Any) -> str:
    match kind:
        case PairOf(item):
            sides = [_format_field(item, side) for side in content]
            return sides[0] if sides[0] == sides[1] else f"[{', '.join(sides)}]"
        case RecordOf():
            return _format_mapping(_format_fields(content))
        case OneOf(variants):
            word = next(word for word, variant in variants.items() if type(content) is variant)
            return _format_mapping({"type": word, **_format_fields(content)})
        case NumberWithUnit():
            return _format_number(content)
        case WordChoice():
            return str(content)
        case TablePath():
            return json.dumps(Path(content.source.path).name)
        case Interval() | NumberList():
            return _format_numbers(content)
    return json.dumps(content)


def _format_mapping(fields: Mapping[str, str]) -> str:
    return f"{{{', '.join(f'{name}: {text}' for name, text in fields.items())}}}"


def _format_limits(limits: Limits) -> str:
    parts = []
    if limits.position != UNBOUNDED:
        parts.append(f"position: {_format_numbers(limits.position)}")
    if limits.velocity != UNBOUNDED:
        parts.append(f"velocity: {_format_number(limits.velocity[1])}")
    return f"{{{', '.join(parts)}}}"


def _format_pose(pose: Pose) -> str:
    return f"{{xyz: {_format_numbers(pose.xyz)}, rpy: [{', '.join(map(_format_angle, pose.rpy))}]}}"


def _format_numbers(numbers: Iterable[float]) -> str:
    return f"[{', '.join(map(_format_number, numbers))}]"


def _format_number(number: float) -> str:
    """Return the shortest text that reads back as the same number."""
    return repr(int(number)) if number.is_integer() and abs(number) < 1e15 else repr(number)


def _format_angle(angle: float) -> str:
    """Return the text of an angle in rad; a multiple of pi/2 becomes an expression."""
    quarters = round(angle / (math.pi / 2))
    if quarters == 0 or quarters * (math.pi / 2) != angle:
        return _format_number(angle)
    sign, quarters = ("-" if quarters < 0 else ""), abs(quarters)
    factor = "" if quarters in (1, 2) else f"{quarters}*" if quarters % 2 else f"{quarters // 2}*"
    return f"{sign}{factor}pi{'/2' if quarters % 2 else ''}"


def _append_comment(line: str, comment: str) -> str:
    return f"{line:{COMMENT_COLUMN}}{'' if len(line) < COMMENT_COLUMN else '  '}{comment}".rstrip()
