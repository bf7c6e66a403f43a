"""A conversion as text: what it did, and the robot file, with comments on what to replace."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator

from vsacli.actuators.antagonistic import Antagonistic
from vsacli.actuators.elastic import Elastic
from vsacli.actuators.kinds import Actuator
from vsacli.actuators.laws.cubic import Cubic
from vsacli.actuators.motor import Motor
from vsacli.actuators.rigid import Rigid
from vsacli.robot.file import FORMAT
from vsacli.robot.model import UNBOUNDED, DenavitHartenberg, Joint, Limits, Link, Pose
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
    yield from _actuator_lines(joint.actuator, origin.urdf.limit.effort)
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


def _actuator_lines(actuator: Actuator, effort: float | None) -> Iterator[str]:
    yield "    actuator:"
    match actuator:
        case Antagonistic(motor=(motor, _), spring=(Cubic() as spring, _)):
            bound = "" if effort is None else f"; the joint's effort limit there is {_number(effort)}"
            yield "      type: antagonistic"
            yield _commented(f"      motor: {_motor(motor)}", PLACEHOLDER + bound)
            law = f"{{type: cubic, k: {_number(spring.k)}, k_c: {_number(spring.k_c)}}}"
            yield _commented(f"      spring: {law}", PLACEHOLDER)
        case Elastic(motor=motor, stiffness=stiffness):
            yield "      type: elastic"
            yield _commented(f"      motor: {_motor(motor)}", _motor_comment(motor))
            yield _commented(f"      stiffness: {_number(stiffness)}", PLACEHOLDER)
        case Rigid(motor=motor):
            yield "      type: rigid"
            yield _commented(f"      motor: {_motor(motor)}", _motor_comment(motor))


def _motor(motor: Motor) -> str:
    bound = f", max_torque: {_number(motor.max_torque)}" if math.isfinite(motor.max_torque) else ""
    return f"{{inertia: {_number(motor.inertia)}{bound}}}"


def _motor_comment(motor: Motor) -> str:
    return PLACEHOLDER + (", but for the effort limit" if math.isfinite(motor.max_torque) else "")


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
