"""Parameters of a robot, by path, and robots with other values or scalars (duals, symbols) in their place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

from vsacli.base.did_you_mean import MOST_NEAR, nearest
from vsacli.base.errors import InputError
from vsacli.base.units import Quantity
from vsacli.compute.duals import seeds
from vsacli.documents.record_checks import replaced_unchecked
from vsacli.documents.record_values import (
    NumberPath,
    PathIndex,
    numbers_in_record,
    with_numbers,
)
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot

JOINTS = "joints"

LIMITS, LARGEST, OF_DAMPER = "limits", "max_", ("damper", "range")
"""Words of paths to numbers that bound results but change none, and so are no parameters: those under
`limits`, the range of a damper, and names that begin with `max_`."""


class Parameter(NamedTuple):
    """A number of a robot on which results depend.

    Attributes:
        path: path of the number in the robot.
        quantity: physical quantity.
        value: value in SI units.
        requirement: condition on its value in a robot file, e.g. "positive"; "" if it may be any number.
        joint: index of its joint; None if it belongs to the whole robot.
        joint_type: type of that joint; "" without one.
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
        """Words of the path, with entries of lists by their index."""
        return tuple(str(step.number) if isinstance(step, PathIndex) else step for step in self.path)

    def matches(self, *patterns: str) -> bool:
        """Return whether the path, with entries of lists by name or by index, matches one of the patterns."""
        paths = (str(self), ".".join(self.by_index))
        return any(fnmatchcase(path, pattern) for path in paths for pattern in patterns)

    @property
    def of_every_joint(self) -> str:
        """Pattern of this parameter of all joints, e.g. `joints.*.link.mass`."""
        return str(self) if self.joint is None else ".".join((JOINTS, "*", *map(str, self.path[2:])))

    @property
    def part(self) -> str:
        """Part of its joint, e.g. `dh`, or of the robot: `gravity`, `base` or `tool`."""
        return str(self.path[0] if self.joint is None else self.path[2])

    @property
    def of_its_part(self) -> str:
        """Pattern of all parameters of the same part, e.g. `joints.*.link.*`."""
        words = self.of_every_joint.split(".")
        part = words[: 1 if self.joint is None else 3]
        return ".".join(words if words == part else [*part, "*"])

    @property
    def unit(self) -> str:
        """SI unit of the value."""
        return self.quantity.unit(self.joint_type)


def parameters(robot: Robot, patterns: Sequence[str] = ()) -> tuple[Parameter, ...]:
    """Return the parameters of a robot.

    Args:
        robot: robot.
        patterns: patterns of paths, e.g. `joints.*.actuator.spring.*`, of which a parameter must match one;
            empty for all parameters. An entry of a list is given by its name or index.

    Raises:
        InputError: a pattern matches no parameter.
    """
    available = [number for number in numbers_of_robot(robot) if _affects_results(number.path)]
    for pattern in patterns:
        if not any(each.matches(pattern) for each in available):
            raise InputError.one(no_match(pattern, available))
    return tuple(each for each in available if not patterns or each.matches(*patterns))


def numbers_of_robot(robot: Robot) -> Iterator[Parameter]:
    """Yield all finite numbers of a robot, limits included."""
    for number in numbers_in_record(robot):
        entry = number.path[1] if number.path[0] == JOINTS else None
        if isinstance(entry, PathIndex):
            yield Parameter(*number, entry.number, robot.joints[entry.number].type)
        else:
            yield Parameter(*number, None, "")


def no_match(pattern: str, available: Sequence[Parameter]) -> str:
    """Return the problem of a pattern that no parameter matches, with patterns that do.

    A path is compared word by word. Of a pattern with `*` only the last word counts, since `*` also stands
    for several words.
    """
    near = (
        []
        if "*" in pattern
        else [path for path in map(str, available) if _are_similar_paths(pattern, path)][:1]
    )
    patterns = list(dict.fromkeys(each.of_every_joint for each in available))
    word = nearest(_last_word(pattern), dict.fromkeys(map(_last_word, patterns)))
    near = near or [each for each in patterns if _last_word(each) == word]
    problem = f"no parameter of the robot matches {pattern!r}"
    if 0 < len(near) <= MOST_NEAR:
        return f"{problem}; did you mean {' or '.join(map(repr, near))}?"
    return f"{problem}; valid: {', '.join(dict.fromkeys(each.of_its_part for each in available))}"


def _last_word(path: str) -> str:
    return path.rpartition(".")[2]


def _are_similar_paths(one: str, other: str) -> bool:
    words, other_words = one.split("."), other.split(".")
    return len(words) == len(other_words) and all(map(nearest, words, ([each] for each in other_words)))


def _affects_results(path: NumberPath) -> bool:
    bounds = LIMITS in path or path[2:4] == OF_DAMPER
    return not bounds and not str(path[-1]).startswith(LARGEST)


def seeded(robot: Robot, chosen: Sequence[Parameter]) -> Robot:
    """Return a robot that carries derivatives with respect to some of its parameters; see `with_numbers`."""
    return with_numbers(robot, chosen, seeds([parameter.value for parameter in chosen]))


def with_copied_actuator(joint: Joint) -> Joint:
    """Return the joint with its own copy of the actuator, which several robots may share."""
    return replaced_unchecked(joint, {"actuator": replaced_unchecked(joint.actuator, {})})
