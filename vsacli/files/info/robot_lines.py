"""Description of a robot as text: tables of geometry, masses and drives, and lines of the actuators."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from vsacli.actuators.kinds import ACTUATORS
from vsacli.base.tables import aligned
from vsacli.base.texts import counted, together, warnings_and_notes
from vsacli.base.units import DAMPING, DIMENSIONLESS, POSITION, STIFFNESS, TORQUE, Quantity
from vsacli.documents.fields import Field, declared_fields, variant_inside
from vsacli.files.info.text import row, short, span

Values = Mapping[str, Any]
"""Values of a record by field, as in JSON."""


PLACES = {"link": "between its links", "transmission": "parallel to its springs"}


def robot_lines(robot: Values) -> Iterator[str]:
    """Yield the description of a robot as lines of text."""
    joints = robot["joints"]
    yield f"robot {robot['name']}: {counted(len(joints), 'joint')}, {short(robot['mass'])} kg"
    if robot["description"]:
        yield robot["description"]
    yield f"gravity {row(robot['gravity'])} m/s^2 in the base frame"
    yield f"base {_pose(robot['base'])}"
    if "tools" in robot:
        yield from ("", *aligned(list(_tools(robot))), "reach: from the origin of DH frame 0")
    elif (reach := robot["reach"]) is not None:
        yield f"tool {_pose(robot['tool'])}"
        bound = f"bound {short(reach['bound'])} m"
        yield f"reach {short(reach['found'])} m from the origin of DH frame 0; {bound}"
    yield from ("", *aligned(list(_geometry(joints))))
    yield from _mount_rows(joints)
    yield from ("", *aligned(list(_masses(joints))))
    yield from ("", *aligned(list(_drives(joints))), "")
    yield "static load: the largest torque of gravity that was found, over configurations within the limits"
    yield "stiffness: attainable at rest, without load and with the static load in either direction"
    yield from ("", *device_lines(joints))
    yield from _dampers(joints)
    if robot["held_at_zero"]:
        yield f"without position limits, and held at zero: {', '.join(robot['held_at_zero'])}"
    yield from warnings_and_notes(robot["warnings"], ())


def _pose(pose: Values) -> str:
    return f"xyz {row(pose['xyz'])} m, rpy {row(pose['rpy'])} rad"


def _tools(robot: Values) -> Iterator[tuple[str, ...]]:
    yield "tool", "on", "xyz [m]", "rpy [rad]", "reach [m]", "bound [m]"
    for name, tool in robot["tools"].items():
        reach = robot["reach"][name]
        frame = row(tool["xyz"]), row(tool["rpy"])
        yield name, tool["joint"], *frame, short(reach["found"]), short(reach["bound"])


def _geometry(joints: Sequence[Values]) -> Iterator[tuple[str, ...]]:
    on = ("on",) if any("parent" in joint for joint in joints) else ()
    yield "joint", *on, "type", "a [m]", "alpha [rad]", "d [m]", "theta [rad]", "limits"
    for joint in joints:
        carrier = (joint["parent"] or "frame 0",) if on else ()
        numbers = (short(joint["dh"][name]) for name in ("a", "alpha", "d", "theta"))
        unit = POSITION.unit(joint["type"])
        limits = span(joint["limits"]["position"], unit)
        yield joint["name"], *carrier, joint["type"], *numbers, limits


def _mount_rows(joints: Sequence[Values]) -> Iterator[str]:
    """Yield a table of the mounts, if there are any."""
    rows = [
        (joint["name"], row(joint["mount"]["xyz"]), row(joint["mount"]["rpy"]))
        for joint in joints
        if "mount" in joint
    ]
    if rows:
        yield from ("", *aligned([("mount of", "xyz [m]", "rpy [rad]"), *rows]))


def _masses(joints: Sequence[Values]) -> Iterator[tuple[str, ...]]:
    moments = ("xx", "yy", "zz", "xy", "xz", "yz")
    yield "joint", "mass [kg]", "com [m]", *(f"{name} [kg m^2]" for name in moments)
    for joint in joints:
        link = joint["link"]
        inertia = (short(link["inertia"][name]) for name in moments)
        yield joint["name"], short(link["mass"]), row(link["com"]), *inertia


def _drives(joints: Sequence[Values]) -> Iterator[tuple[str, ...]]:
    yield "joint", "actuator", "springs", "static load", "stiffness", "bounds", "under load", "bounds"
    for joint in joints:
        kind, actuator = joint["type"], joint["actuator"]
        load = f"{short(joint['static_load']['torque'])} {TORQUE.unit(kind)}"
        ranges = (word for name in ("unloaded", "loaded") for word in _attainable_words(joint, name))
        yield joint["name"], actuator["type"], _springs(actuator) or "-", load, *ranges


def _attainable_words(joint: Values, load: str) -> tuple[str, str]:
    """Return the attainable stiffness, unloaded or loaded, and what bounds its ends."""
    unit = STIFFNESS.unit(joint["type"])
    if attainable := joint["attainable_stiffness"]:
        bounds = dict.fromkeys(bound or "none" for bound in attainable[load]["bounds"])
        return span(attainable[load]["range"], unit), ", ".join(bounds)
    of_springs = joint["stiffness_range"]
    return (span(of_springs[load], unit), "springs") if of_springs else ("-", "-")


def _dampers(joints: Sequence[Values]) -> Iterator[str]:
    """Yield one line with the places and ranges of dampers, if there are any."""
    words = [
        f"{joint['name']} {PLACES[damper['location']]}, {span(damper['range'], DAMPING.unit(joint['type']))}"
        for joint in joints
        if (damper := joint["damper"])
    ]
    if words:
        yield f"dampers: {'; '.join(words)}"


def _springs(actuator: Values) -> str:
    """Return the types of mechanism, springs and coupling, as far as present."""
    mechanism = actuator.get("mechanism")
    written = (mechanism or actuator).get("spring") or []
    springs = written if isinstance(written, list) else [written]
    words = [mechanism["type"]] if mechanism else []
    words += dict.fromkeys(spring["type"] for spring in springs)
    if actuator.get("coupling"):
        words.append(f"(coupling {actuator['coupling']['type']})")
    return " ".join(words)


def device_lines(joints: Sequence[Values]) -> Iterator[str]:
    """Yield a line for all joints with equal actuators, and below it a line for each part of the actuator."""
    equal: dict[tuple[str, ...], list[int]] = {}
    for number, joint in enumerate(joints):
        kind = ACTUATORS[joint["actuator"]["type"]]
        parts = tuple(_parts(kind, joint["actuator"], joint["type"]))
        equal.setdefault((joint["actuator"]["type"], *parts), []).append(number)
    names = [joint["name"] for joint in joints]
    for (kind_name, *lines), numbers in equal.items():
        yield f"{together(numbers, names)}: {kind_name}"
        yield from (f"  {line}" for line in lines)


def _parts(cls: type, values: Values, joint_type: str) -> Iterator[str]:
    """Yield a line for each record in an actuator, and one line for its own parameters."""
    own = []
    for name, field, value in _given(cls, values):
        if not field.kind.records:
            own.append(_words(name, field.quantity, value, joint_type))
        elif isinstance(value, list) and len(value) > 1 and value.count(value[0]) == len(value):
            numbers = " and ".join(str(number) for number in range(1, len(value) + 1))
            yield f"{name}s {numbers}: {_record(field, value[0], joint_type)}"
        elif isinstance(value, list):
            for number, each in enumerate(value, start=1):
                yield f"{name} {number}: {_record(field, each, joint_type)}"
        else:
            yield f"{name}: {_record(field, value, joint_type)}"
    if own:
        yield ", ".join(own)


def _given(cls: type, values: Values) -> Iterator[tuple[str, Field, Any]]:
    """Yield the fields with a value that is neither absent, infinite nor the default."""
    for name, (field, default) in declared_fields(cls).items():
        value = values.get(name)
        if value is not None and value != default and value != math.inf:
            yield name, field, value


def _record(field: Field, values: Values, joint_type: str) -> str:
    """Return a record of a field in words: its type and its parameters."""
    word = values.get("type", "")
    cls = field.kind.records[word]
    inside = variant_inside(cls, values.get(getattr(cls, "unit_variant", "")), joint_type) or joint_type
    words = [word] if word else []
    for name, each, value in _given(cls, values):
        if each.kind.records:
            several = value if isinstance(value, list) else [value]
            words += [f"{name} ({_record(each, one, inside)})" for one in several]
        else:
            words.append(_words(name, each.quantity.inside(inside), value, joint_type))
    return ", ".join(words)


def _words(name: str, quantity: Quantity, value: Any, joint_type: str) -> str:
    """Return name and value of a field, with its unit."""
    written = quantity.unit(joint_type)
    unit = "" if written == str(DIMENSIONLESS) else f" {written}"
    match value:
        case bool() | str():
            return f"{name} {value}"
        case float() | int():
            return f"{name} {value:.5g}{unit}"
        case list() if all(isinstance(each, float | int) for each in value):
            return f"{name} [{', '.join(f'{each:.5g}' for each in value)}]{unit}"
        case _:
            return name
