"""Descriptions as text: headline, tables, actuators, and notes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from vsacli.actuators.kinds import ACTUATORS
from vsacli.analysis import report_text
from vsacli.base.signals import COMMANDED
from vsacli.base.tables import aligned
from vsacli.base.texts import counted, together
from vsacli.base.units import DAMPING, DIMENSIONLESS, POSITION, STIFFNESS, TORQUE, Quantity
from vsacli.documents.fields import Field, declared, variant_inside
from vsacli.documents.reading import written
from vsacli.files import recordings
from vsacli.files.info.describe import KIND, study_lines
from vsacli.files.stored_reports import stored_report

Values = Mapping[str, Any]
"""Values of a record by field, as in JSON."""


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
    for name, (field, default) in declared(cls).items():
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


Description = Mapping[str, Any]

SHOWN_DIGITS = 5
PLACES = {"link": "between its links", "transmission": "parallel to its springs"}
MOTION = ("dq", "ddq", "d3q", "d4q")


def render(description: Description) -> str:
    """Return a description as lines of text, without a final newline."""
    return "\n".join(_RENDERERS[description["kind"]](description))


def _robot(robot: Description) -> Iterator[str]:
    reach, joints = robot["reach"], robot["joints"]
    yield f"robot {robot['name']}: {counted(len(joints), 'joint')}, {_short(robot['mass'])} kg"
    if robot["description"]:
        yield robot["description"]
    yield f"gravity {_row(robot['gravity'])} m/s^2 in the base frame"
    for name in ("base", "tool"):
        pose = robot[name]
        yield f"{name} xyz {_row(pose['xyz'])} m, rpy {_row(pose['rpy'])} rad"
    yield f"reach {_short(reach['found'])} m from the origin of DH frame 0; bound {_short(reach['bound'])} m"
    yield from ("", *aligned(list(_geometry(joints))))
    yield from ("", *aligned(list(_masses(joints))))
    yield from ("", *aligned(list(_drives(joints))), "")
    yield "static load: the largest torque of gravity that was found, over configurations within the limits"
    yield "stiffness: attainable without load, and with the static load in either direction"
    yield from ("", *device_lines(joints))
    yield from _dampers(joints)
    if robot["held_at_zero"]:
        yield f"without position limits, and held at zero: {', '.join(robot['held_at_zero'])}"
    yield from report_text.warnings_and_notes(robot["warnings"], ())


def _geometry(joints: Sequence[Description]) -> Iterator[tuple[str, ...]]:
    yield "joint", "type", "a [m]", "alpha [rad]", "d [m]", "theta [rad]", "limits"
    for joint in joints:
        row = (_short(joint["dh"][name]) for name in ("a", "alpha", "d", "theta"))
        unit = POSITION.unit(joint["type"])
        yield joint["name"], joint["type"], *row, _span(joint["limits"]["position"], unit)


def _masses(joints: Sequence[Description]) -> Iterator[tuple[str, ...]]:
    moments = ("xx", "yy", "zz", "xy", "xz", "yz")
    yield "joint", "mass [kg]", "com [m]", *(f"{name} [kg m^2]" for name in moments)
    for joint in joints:
        link = joint["link"]
        inertia = (_short(link["inertia"][name]) for name in moments)
        yield joint["name"], _short(link["mass"]), _row(link["com"]), *inertia


def _drives(joints: Sequence[Description]) -> Iterator[tuple[str, ...]]:
    yield "joint", "actuator", "springs", "static load", "stiffness", "under load"
    for joint in joints:
        kind, actuator, ranges = joint["type"], joint["actuator"], joint["stiffness_range"]
        unit = STIFFNESS.unit(kind)
        attainable = (_span(ranges[name], unit) if ranges else "-" for name in ("unloaded", "loaded"))
        load = f"{_short(joint['static_load']['torque'])} {TORQUE.unit(kind)}"
        yield joint["name"], actuator["type"], _springs(actuator) or "-", load, *attainable


def _dampers(joints: Sequence[Description]) -> Iterator[str]:
    """Yield one line with the places and ranges of dampers, if there are any."""
    words = [
        f"{joint['name']} {PLACES[damper['location']]}, {_span(damper['range'], DAMPING.unit(joint['type']))}"
        for joint in joints
        if (damper := joint["damper"])
    ]
    if words:
        yield f"dampers: {'; '.join(words)}"


def _springs(actuator: Description) -> str:
    """Return the types of mechanism, springs and coupling, as far as present."""
    mechanism = actuator.get("mechanism")
    written = (mechanism or actuator).get("spring") or []
    springs = written if isinstance(written, list) else [written]
    words = [mechanism["type"]] if mechanism else []
    words += dict.fromkeys(spring["type"] for spring in springs)
    if actuator.get("coupling"):
        words.append(f"(coupling {actuator['coupling']['type']})")
    return " ".join(words)


def _trajectory(trajectory: Description) -> Iterator[str]:
    samples = counted(trajectory["samples"], "sample")
    yield (
        f"trajectory {trajectory['name']}: {samples}, {_short(trajectory['duration'])} s from t = "
        f"{_short(trajectory['start'])} s"
    )
    commanded = [key for key in COMMANDED if key in trajectory["joints"][0]]
    rows = [("joint", "q", *(f"peak {name}" for name in MOTION), *commanded)]
    rows += [
        (
            joint["name"],
            _range(joint["q"]),
            *(_short(joint[name]["peak"]) for name in MOTION),
            *(_range(joint[key]) for key in commanded),
        )
        for joint in trajectory["joints"]
    ]
    yield from aligned(rows)
    units = (f"; {key} {COMMANDED[key].quantities[0]}" for key in commanded)
    yield f"units: q {POSITION}, its k-th derivative per s^k{''.join(units)}"
    if "wrench" in trajectory:
        yield from _wrench(trajectory["wrench"])
    yield from report_text.warnings_and_notes(trajectory["warnings"], trajectory["notes"])


def _wrench(wrench: Description) -> Iterator[str]:
    axes = [axis for axis in wrench if axis != "frame"]
    ranges = ", ".join(f"{axis} {_range(wrench[axis]['wrench'])}" for axis in axes)
    yield f"wrench along the axes of {wrench['frame']}, N and N m: {ranges}"


def _result(result: Description) -> Iterator[str]:
    whole, samples = "" if result["complete"] else ", ended early", counted(result["samples"], "sample")
    yield f"{result['kind']} of {result['robot']}, {result['trajectory']}: {samples}{whole}"
    yield f"verdict {result['verdict']}"
    source = result["provenance"]
    versions = ", ".join(f"{name} {version}" for name, version in source["versions"].items())
    yield f"created {source['created']} by {source['generated_by']} ({versions})"
    yield f"command line: {source['command_line']}"
    if "engine" in source:
        compiled = f", compiled by {source['compiler']}, threads: {source['threads']}"
        yield f"engine: {source['engine']}{compiled if source['compiler'] else ''}"
    if "precision" in source:
        yield f"values stored in {source['precision']} precision"
    for each in source["inputs"]:
        yield f"input {each['path']}, SHA-256 {each['sha256']}"
        yield from (f"  with --set {change}" for change in written(each.get("changes", {})))
    rows = [("joint", "type", "actuator")]
    rows += [(joint["name"], joint["type"], joint["actuator"]) for joint in result["joints"]]
    yield from ("", *aligned(rows), "")
    yield from _left(
        [
            (each["name"], ", ".join(each["dims"]), each["units"], each["meaning"])
            for each in result["variables"]
        ]
    )
    yield from ("", str(stored_report(result["kind"], result["report"])))


def _cache(cache: Description) -> Iterator[str]:
    libraries = counted(cache["entries"], "library", "libraries")
    size, limit = _megabytes(cache["size"]), _megabytes(cache["limit"])
    yield f"compiled code: {libraries}, {size} of at most {limit}, in {cache['folder']}"
    for each in cache["unfinished"]:
        yield f"unfinished: {each['path']}, {_megabytes(each['size'])}, {_OWNERS[each['owner']]}"


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.3g} MB"


def _left(rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """Yield a table with all columns aligned left."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "   ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()


def _row(values: Iterable[float]) -> str:
    return " ".join(map(_short, values))


def _short(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.{SHOWN_DIGITS}g}"


def _range(ends: Mapping[str, float]) -> str:
    low, high = ends["min"], ends["max"]
    return _short(low) if math.isnan(low) or low == high else f"{_short(low)} to {_short(high)}"


def _span(ends: Sequence[float], unit: str) -> str:
    low, high = ends
    if math.isnan(low) or low > high:
        return "none"
    if math.isinf(low) and math.isinf(high):
        return "-"
    if low == high:
        return f"{_short(low)} {unit}"
    if math.isinf(high):
        return f"from {_short(low)} {unit}"
    return f"to {_short(high)} {unit}" if math.isinf(low) else f"{_short(low)} to {_short(high)} {unit}"


_OWNERS = {
    "ended": "of a process that has ended: the next command that writes there removes it",
    "running": "of a process that is running",
    "elsewhere": "of another host or container: remove it if nothing runs there any more",
}
_RENDERERS: dict[str, Callable[[Description], Iterator[str]]] = {
    "robot": _robot,
    "trajectory": _trajectory,
    "result": _result,
    "simulation": _result,
    "cache": _cache,
    KIND: study_lines,
    recordings.KIND: recordings.recording_lines,
}
