"""What drives the joints of a robot, with its numbers; joints that are driven alike stand together."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from vsacli.actuators.kinds import ACTUATORS
from vsacli.base.texts import together
from vsacli.base.units import DIMENSIONLESS, Quantity
from vsacli.documents.fields import declared
from vsacli.documents.records import Field

Values = Mapping[str, Any]
"""Of a record, by field, as JSON has them."""


def device_lines(joints: Sequence[Values]) -> Iterator[str]:
    """Joints that are driven alike in a line, and below them each part of their actuator."""
    alike: dict[tuple[str, ...], list[int]] = {}
    for number, joint in enumerate(joints):
        kind = ACTUATORS[joint["actuator"]["type"]]
        parts = tuple(_parts(kind, joint["actuator"], joint["type"]))
        alike.setdefault((joint["actuator"]["type"], *parts), []).append(number)
    names = [joint["name"] for joint in joints]
    for (kind_name, *lines), numbers in alike.items():
        yield f"{together(numbers, names)}: {kind_name}"
        yield from (f"  {line}" for line in lines)
    if any("gear_ratio" in line for parts in alike for line in parts):
        yield "numbers of a motor with gear_ratio are those of its shaft"


def _parts(cls: type, values: Values, joint_type: str) -> Iterator[str]:
    """A line for each record in an actuator, and one for the numbers beside them."""
    own = []
    for name, field, value in _given(cls, values):
        if not field.kind.records:
            own.append(_words(name, field.quantity, value, joint_type))
        elif isinstance(value, list) and len(value) > 1 and value.count(value[0]) == len(value):
            yield f"{name}, both alike: {_record(field, value[0], joint_type)}"
        elif isinstance(value, list):
            for number, each in enumerate(value, start=1):
                yield f"{name} {number}: {_record(field, each, joint_type)}"
        else:
            yield f"{name}: {_record(field, value, joint_type)}"
    if own:
        yield ", ".join(own)


def _given(cls: type, values: Values) -> Iterator[tuple[str, Field, Any]]:
    """The fields that say something: none that is absent, infinite or as it is by default."""
    for name, (field, default) in declared(cls).items():
        value = values.get(name)
        if value is not None and value != default and value != math.inf:
            yield name, field, value


def _record(field: Field, values: Values, joint_type: str) -> str:
    """A record of a field: the word that chose it, and its numbers."""
    word = values.get("type", "")
    cls = field.kind.records[word]
    key, other_type = getattr(cls, "unit_variant_with", ("", joint_type))
    inside = other_type if values.get(key) is not None else joint_type
    words = [word] if word else []
    for name, each, value in _given(cls, values):
        if each.kind.records:
            several = value if isinstance(value, list) else [value]
            words += [f"{name} ({_record(each, one, inside)})" for one in several]
        else:
            words.append(_words(name, each.quantity, value, inside))
    return ", ".join(words)


def _words(name: str, quantity: Quantity, value: Any, joint_type: str) -> str:
    """A field and what it is, with its unit."""
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
