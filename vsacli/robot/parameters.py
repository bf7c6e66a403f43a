"""The numbers of a robot that results depend on, and robots with others in their place, of any kind."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any, NamedTuple, TypeVar

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.base.units import Quantity
from vsacli.compute.duals import seeds
from vsacli.compute.vector import Scalar
from vsacli.documents.record_values import Entry, Number, NumberPath, numbers
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot

JOINTS = "joints"

LIMITS, LARGEST, OF_DAMPER = "limits", "max_", ("damper", "range")
"""Words of paths to numbers that bound results and change none: those under `limits`, the range of a damper,
and those that begin by `max_`."""

_Record = TypeVar("_Record")


class Parameter(NamedTuple):
    """A number of a robot.

    Attributes:
        path: to it, from the robot.
        quantity: what it measures.
        value: in SI units.
        requirement: what the robot file demands of it, e.g. "positive"; "" if it may be any number.
        joint: index of its joint; None if it is of the whole robot.
        joint_type: of that joint, "" if there is none.
    """

    path: NumberPath
    quantity: Quantity
    value: float
    requirement: str
    joint: int | None
    joint_type: str

    def __str__(self) -> str:
        return ".".join(map(str, self.path))

    @property
    def by_index(self) -> tuple[str, ...]:
        """The words of the path, with entries of lists by their index."""
        return tuple(str(step.number) if isinstance(step, Entry) else step for step in self.path)

    @property
    def part(self) -> str:
        """Part of a joint it belongs to, e.g. `dh`; of the robot, `gravity`, `base` or `tool`."""
        return str(self.path[0] if self.joint is None else self.path[2])

    @property
    def unit(self) -> str:
        """SI unit."""
        return self.quantity.unit(self.joint_type)


def parameters(robot: Robot, patterns: Sequence[str] = ()) -> tuple[Parameter, ...]:
    """Return the numbers of a robot that results depend on.

    Args:
        robot: the robot.
        patterns: only those whose path fits one of these, e.g. `joints.*.actuator.spring.*`; all if empty.
            An entry of a list goes by its name or by its index.

    Raises:
        InputError: a pattern fits none.
    """
    found = [_parameter(robot, number) for number in numbers(robot) if _matters(number.path)]
    chosen = [each for each in found if not patterns or any(_fits(each, pattern) for pattern in patterns)]
    for pattern in patterns:
        if not any(_fits(each, pattern) for each in found):
            hint = did_you_mean(pattern, [str(each) for each in found])
            raise InputError.one(f"no number of the robot fits {pattern!r}{hint}")
    return tuple(chosen)


def _matters(path: NumberPath) -> bool:
    bounds = LIMITS in path or path[2:4] == OF_DAMPER
    return not bounds and not str(path[-1]).startswith(LARGEST)


def _fits(parameter: Parameter, pattern: str) -> bool:
    words = (str(parameter), ".".join(parameter.by_index))
    return any(fnmatchcase(path, pattern) for path in words)


def _parameter(robot: Robot, number: Number) -> Parameter:
    entry = number.path[1] if number.path[0] == JOINTS else None
    if not isinstance(entry, Entry):
        return Parameter(*number, None, "")
    return Parameter(*number, entry.number, robot.joints[entry.number].type)


def seeded(robot: Robot, chosen: Sequence[Parameter]) -> Robot:
    """Return a robot that carries derivatives by some of its parameters (see `with_numbers`)."""
    return with_numbers(robot, chosen, seeds([parameter.value for parameter in chosen]))


def with_numbers(robot: Robot, chosen: Sequence[Parameter], values: Sequence[Scalar]) -> Robot:
    """Return a robot with other values of some of its numbers, scalars of any kind.

    It is none to be checked or written: records on the way to those numbers are made without their checks.
    """
    places = [(parameter.path, value) for parameter, value in zip(chosen, values, strict=True)]
    other: Robot = _with_numbers(robot, places)
    return other


def _with_numbers(content: Any, places: Iterable[tuple[NumberPath, Scalar]]) -> Any:
    """Return a record or list with other numbers at some paths."""
    inside: dict[str | int, list[tuple[NumberPath, Scalar]]] = {}
    for path, scalar in places:
        if not path:  # of a pair of numbers that are one, both
            return (scalar,) * len(content) if isinstance(content, tuple) else scalar
        word = path[0].number if isinstance(path[0], Entry) else path[0]
        inside.setdefault(word, []).append((path[1:], scalar))
    if isinstance(content, tuple):
        return _in_list(content, inside)
    fields: dict[str, Any] = {
        str(word): _with_numbers(getattr(content, str(word)), deeper) for word, deeper in inside.items()
    }
    return _remade(content, fields)


def _in_list(
    entries: tuple[Any, ...], inside: Mapping[str | int, list[tuple[NumberPath, Scalar]]]
) -> tuple[Any, ...]:
    """Return a list with an entry replaced; without a number a path changes both sides of equal pairs."""
    both = [
        ((word, *path), scalar)
        for word, deeper in inside.items()
        if isinstance(word, str)
        for path, scalar in deeper
    ]
    if both:
        return (_with_numbers(entries[0], both),) * len(entries)
    return tuple(
        _with_numbers(entry, inside[index]) if index in inside else entry
        for index, entry in enumerate(entries)
    )


def apart(joint: Joint) -> Joint:
    """Return the joint with an actuator that is no other's, as one may be of several robots."""
    return _remade(joint, {"actuator": _remade(joint.actuator, {})})


def _remade(record: _Record, contents: Mapping[str, Any]) -> _Record:
    """Return a record with other values in some fields, without its checks and cached values."""
    new = object.__new__(type(record))
    for field in dataclasses.fields(record):  # type: ignore[arg-type]  # declared fields are those of dataclasses
        object.__setattr__(new, field.name, contents.get(field.name, getattr(record, field.name)))
    return new
