"""A conversion as text: what it did, and the robot file, with comments on what to replace."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from vsacli.actuators.actuator import Actuator
from vsacli.documents.fields import Interval, Kind, Number, OneOf, Pair, Record, Vector, declared
from vsacli.robot.file import FORMAT
from vsacli.robot.joint import UNBOUNDED, DenavitHartenberg, Joint, Limits, Link, Pose
from vsacli.robot.urdf.conversion import Conversion
from vsacli.robot.urdf.residual import Residual
from vsacli.robot.urdf.serial_chain import ChainJoint

EXACT_RESIDUAL = 1e-9
"""m and rad; kinematics that stray less are called the same."""

SMALLEST_RESIDUAL = 1e-12
"""m and rad; smaller residuals differ between machines, and are not told apart."""

_HEADER = ("joint", "a/m", "alpha/rad", "d/m", "theta/rad", "mass/kg", "links")
PLACEHOLDER = "# placeholder: not from the URDF"
COMMENT_COLUMN = 34
MAX_LINKS = 4
"""Links that a comment names before it counts the rest."""


def render(conversion: Conversion) -> str:
    """The Denavit-Hartenberg table, what was left out or changed, and how exact the result is."""
    return "\n".join(_lines(conversion))


def _lines(conversion: Conversion) -> Iterator[str]:
    robot, chain = conversion.robot, conversion.chain
    count = len(robot.joints)
    yield f"{robot.name}: {count} joint{'s' if count > 1 else ''} from {chain.base} to {chain.tip}"
    yield from _aligned(_table(conversion))
    yield f"total mass of the moving links: {sum(joint.link.mass for joint in robot.joints):.6g} kg"
    yield _exactness(conversion.residual)
    yield from (f"warning: {warning}" for warning in conversion.warnings())
    yield from conversion.notes()


def _exactness(residual: Residual) -> str:
    verdict = "the same as" if max(residual) <= EXACT_RESIDUAL else "not quite"
    position, orientation = (max(error, SMALLEST_RESIDUAL) for error in residual)
    errors = f"{position:.1e} m and {orientation:.1e} rad"
    return f"forward kinematics: {verdict} the URDF's, the tip within {errors}"


def _table(conversion: Conversion) -> Iterator[tuple[str, ...]]:
    yield _HEADER
    for joint, origin in zip(conversion.robot.joints, conversion.chain.joints, strict=True):
        row = (joint.dh.a, joint.dh.alpha, joint.dh.d, joint.dh.theta, joint.link.mass)
        others = len(origin.links) - 1
        carried = origin.links[0].name + (f" + {others}" if others else "")
        yield (joint.name, *(f"{number:.6g}" for number in row), carried)


def _aligned(rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    """Columns of one width, numbers to the right."""
    table = list(rows)
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for first, *numbers, last in table:
        cells = [f"{cell:>{width}}" for cell, width in zip(numbers, widths[1:-1], strict=True)]
        yield "  ".join([f"{first:<{widths[0]}}", *cells, last])


def robot_text(conversion: Conversion) -> str:
    """The robot file; `load_robot` gives the same robot again."""
    robot = conversion.robot
    lines = [
        "# From a URDF, by vsacli import-urdf: frames, masses, inertias, damping and limits of the joints.",
        "# A URDF says nothing about motors and springs: replace what is marked as placeholder.",
        f"format: {FORMAT}",
        f"name: {json.dumps(robot.name)}",
        f"description: {json.dumps(robot.description)}",
        "placeholder: true",
        _commented(f"gravity: {_numbers(robot.gravity)}", "# m/s^2, in the axes of the base link"),
        _commented(f"base: {_pose(robot.base)}", "# DH frame 0 in the base link; m, rad"),
        _commented(f"tool: {_pose(robot.tool)}", "# tip link in the last DH frame"),
        "joints:",
    ]
    for joint, origin in zip(robot.joints, conversion.chain.joints, strict=True):
        lines += _joint_lines(joint, origin)
    return "\n".join([*lines, ""])


def _joint_lines(joint: Joint, origin: ChainJoint) -> Iterator[str]:
    renamed = "" if origin.urdf.name == joint.name else f"# {json.dumps(origin.urdf.name)} in the URDF"
    yield _commented(f"  - name: {joint.name}", renamed)
    yield f"    type: {joint.type}"
    yield f"    dh: {_row(joint.dh)}"
    yield _commented("    link:", _links_comment([link.name for link in origin.links]))
    yield from _link_lines(joint.link)
    if joint.damping:
        yield f"    damping: {_number(joint.damping)}"
    yield from _actuator_lines(joint, origin.urdf.limit.effort)
    if joint.limits != Limits():
        yield f"    limits: {_limits(joint.limits)}"


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


def _actuator_lines(joint: Joint, effort: float | None) -> Iterator[str]:
    actuator = joint.actuator
    yield "    actuator:"
    yield f"      type: {joint.actuator_type}"
    for name, written in _written(actuator).items():
        comment = _motor_comment(actuator, effort) if name == "motor" else ""
        yield _commented(f"      {name}: {written}", PLACEHOLDER + comment)


def _motor_comment(actuator: Actuator, effort: float | None) -> str:
    if any(math.isfinite(motor.max_torque) for motor in actuator.motors):
        return ", but for the effort limit"
    if effort is None or actuator.motor_count == 1:
        return ""
    return f"; the joint's effort limit there is {_number(effort)}"


def _written(record: Any) -> dict[str, str]:
    """The fields of a record as they are written on one line, but for those that have their default."""
    values = {name: getattr(record, name) for name in declared(type(record))}
    return {
        name: _value(field.kind, values[name])
        for name, (field, default) in declared(type(record)).items()
        if values[name] != default
    }


def _value(kind: Kind, content: Any) -> str:
    match kind:
        case Pair(item):
            sides = [_value(item, side) for side in content]
            return sides[0] if sides[0] == sides[1] else f"[{', '.join(sides)}]"
        case Record():
            return _mapping(_written(content))
        case OneOf(variants):
            word = next(word for word, variant in variants.items() if type(content) is variant)
            return _mapping({"type": word, **_written(content)})
        case Number():
            return _number(content)
        case Interval() | Vector():
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
    """The fewest digits that give the same number again, without a superfluous zero."""
    return repr(int(number)) if number.is_integer() and abs(number) < 1e15 else repr(number)


def _angle(angle: float) -> str:
    """The angle in rad; a multiple of pi/2 as an expression."""
    quarters = round(angle / (math.pi / 2))
    if quarters == 0 or quarters * (math.pi / 2) != angle:
        return _number(angle)
    sign, quarters = ("-" if quarters < 0 else ""), abs(quarters)
    factor = "" if quarters in (1, 2) else f"{quarters}*" if quarters % 2 else f"{quarters // 2}*"
    return f"{sign}{factor}pi{'/2' if quarters % 2 else ''}"


def _commented(line: str, comment: str) -> str:
    return f"{line:{COMMENT_COLUMN}}{'' if len(line) < COMMENT_COLUMN else '  '}{comment}".rstrip()
