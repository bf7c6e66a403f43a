"""The text of a robot file for a converted robot, with comments on the placeholders to replace."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
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
    ValueKind,
    WordChoice,
    declared_fields,
)
from vsacli.robot.joint import UNBOUNDED, DenavitHartenberg, Limits, Link, Pose
from vsacli.robot.urdf.conversion import Conversion
from vsacli.robot.urdf.link_tree import UrdfJoint

COMMENT_COLUMN = 34
MAX_LINKS = 4
"""Most links that a comment names before it counts the rest."""


def robot_text(conversion: Conversion) -> str:
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
        _commented(f"gravity: {_numbers(robot.gravity)}", "# m/s^2, in the axes of the base link"),
        _commented(f"base: {_pose(robot.base)}", "# DH frame 0 in the base link; m, rad"),
        _commented(f"tool: {_pose(robot.tool)}", "# tip link in the last DH frame"),
        "joints:",
    ]
    for index in range(len(robot.joints)):
        lines += _joint_lines(conversion, index)
    return "\n".join([*lines, ""])


def _joint_lines(conversion: Conversion, index: int) -> Iterator[str]:
    joint, origin = conversion.robot.joints[index], conversion.chain.joints[index]
    renamed = "" if origin.urdf.name == joint.name else f"# {json.dumps(origin.urdf.name)} in the URDF"
    yield _commented(f"  - name: {joint.name}", renamed)
    yield f"    type: {joint.type}"
    yield f"    dh: {_row(joint.dh)}"
    yield _commented("    link:", _links_comment([link.name for link in origin.links]))
    yield from _link_lines(joint.link)
    if joint.damping:
        yield f"    damping: {_number(joint.damping)}"
    yield "    actuator:"
    yield f"      type: {joint.actuator_type}"
    for name, written in _written(joint.actuator).items():
        comment = f"# placeholder: {_origin_of(name, conversion, index)}"
        yield _commented(f"      {name}: {written}", comment)
    if joint.limits != Limits():
        yield _commented(f"    limits: {_limits(joint.limits)}", "# of the joint's motion")


def _links_comment(names: list[str]) -> str:
    shown = ", ".join(map(json.dumps, names[:MAX_LINKS]))
    return f"# {shown}" + (f" and {len(names) - MAX_LINKS} more" if len(names) > MAX_LINKS else "")


def _row(dh: DenavitHartenberg) -> str:
    return f"{{a: {_number(dh.a)}, alpha: {_angle(dh.alpha)}, d: {_number(dh.d)}, theta: {_angle(dh.theta)}}}"


def _link_lines(link: Link) -> Iterator[str]:
    entries = (
        f"{name}: {_number(getattr(link.inertia, name))}" for name in ("xx", "yy", "zz", "xy", "xz", "yz")
    )
    yield f"      mass: {_number(link.mass)}"
    yield f"      com: {_numbers(link.com)}"
    yield f"      inertia: {{{', '.join(entries)}}}"


def _origin_of(field: str, conversion: Conversion, index: int) -> str:
    """Return the origin of the numbers in a field of an actuator, with motor data of the URDF."""
    joint, load = conversion.chain.joints[index], conversion.loads[index]
    origin = conversion.placeholders.origin(field, joint, load)
    known = " and ".join(_known(joint.urdf))
    if field != "motor" or not known:
        return origin
    return f"{origin}; {'with' if conversion.one_motor_each else 'the URDF has'} {known}"


def _known(joint: UrdfJoint) -> Iterator[str]:
    if joint.limit.effort:
        yield f"an effort limit of {_number(joint.limit.effort)} {joint.unit(TORQUE)} (joint side)"
    if joint.gear_ratio:
        yield f"a gear reduction of {_number(joint.gear_ratio)}"


def _written(record: Any) -> dict[str, str]:
    """Return the text of each field of a record, without fields at their default."""
    values = {name: getattr(record, name) for name in declared_fields(type(record))}
    return {
        name: _value(field.kind, values[name])
        for name, (field, default) in declared_fields(type(record)).items()
        if values[name] != default
    }


def _value(kind: ValueKind, content: Any) -> str:
    match kind:
        case PairOf(item):
            sides = [_value(item, side) for side in content]
            return sides[0] if sides[0] == sides[1] else f"[{', '.join(sides)}]"
        case RecordOf():
            return _mapping(_written(content))
        case OneOf(variants):
            word = next(word for word, variant in variants.items() if type(content) is variant)
            return _mapping({"type": word, **_written(content)})
        case NumberWithUnit():
            return _number(content)
        case WordChoice():
            return str(content)
        case Interval() | NumberList():
            return _numbers(content)
    return json.dumps(content)


def _mapping(written: Mapping[str, str]) -> str:
    return f"{{{', '.join(f'{name}: {value}' for name, value in written.items())}}}"


def _limits(limits: Limits) -> str:
    parts = []
    if limits.position != UNBOUNDED:
        parts.append(f"position: {_numbers(limits.position)}")
    if limits.velocity != UNBOUNDED:
        parts.append(f"velocity: {_number(limits.velocity[1])}")
    return f"{{{', '.join(parts)}}}"


def _pose(pose: Pose) -> str:
    return f"{{xyz: {_numbers(pose.xyz)}, rpy: [{', '.join(map(_angle, pose.rpy))}]}}"


def _numbers(numbers: Iterable[float]) -> str:
    return f"[{', '.join(map(_number, numbers))}]"


def _number(number: float) -> str:
    """Return the shortest text that reads back as the same number."""
    return repr(int(number)) if number.is_integer() and abs(number) < 1e15 else repr(number)


def _angle(angle: float) -> str:
    """Return the text of an angle in rad; a multiple of pi/2 becomes an expression."""
    quarters = round(angle / (math.pi / 2))
    if quarters == 0 or quarters * (math.pi / 2) != angle:
        return _number(angle)
    sign, quarters = ("-" if quarters < 0 else ""), abs(quarters)
    factor = "" if quarters in (1, 2) else f"{quarters}*" if quarters % 2 else f"{quarters // 2}*"
    return f"{sign}{factor}pi{'/2' if quarters % 2 else ''}"


def _commented(line: str, comment: str) -> str:
    return f"{line:{COMMENT_COLUMN}}{'' if len(line) < COMMENT_COLUMN else '  '}{comment}".rstrip()
