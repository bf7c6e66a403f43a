"""Gains from poles written by users: in one line for all joints, or in a file joint by joint."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from vsacli.base import file_formats
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import FieldProblem, InputError
from vsacli.control.gains import POSITION_ORDER, RIGID_ORDER, STIFFNESS_ORDER, Gains, check_stable
from vsacli.documents.fields import Items, RecordOf, text, value
from vsacli.documents.reading import read_document
from vsacli.documents.record_checks import DeclaredRecord
from vsacli.robot.model import Robot

DEFAULT = "-20"
"""Default of all poles, 1/s: errors settle within half a second."""

Poles = tuple[complex, ...]


@dataclass(frozen=True)
class JointPoles(DeclaredRecord):
    """Poles of the errors of a joint."""

    name: str = text("name of the joint", identifier=True)
    position: str = text("poles of the position error, 1/s; one number applies to all poles")
    stiffness: str = text(
        "poles of the stiffness error, 1/s; one number applies to all poles", default=DEFAULT
    )

    def _problems(self) -> Iterator[FieldProblem]:
        for name in ("position", "stiffness"):
            try:
                for pole in parse_poles(getattr(self, name)):
                    check_stable(name, pole)
            except InputError as error:
                yield FieldProblem((name,), str(error))


@dataclass(frozen=True)
class PolesFile(DeclaredRecord):
    """The content of a poles file."""

    joints: tuple[JointPoles, ...] = value(Items(RecordOf(JointPoles), unique="name"), "poles of each joint")


def parse_poles(text: str, alternative: str = "") -> Poles:
    """Parse poles separated by commas, e.g. `-20, -21, -10+5j, -10-5j`.

    Args:
        text: text of a user.
        alternative: clause on what else the text may be, for the error.

    Raises:
        InputError: the text is something else.
    """
    try:
        return tuple(complex(re.sub(r"\s", "", word)) for word in text.split(","))
    except ValueError:
        expected = f"expected poles such as -20,-21,-10+5j,-10-5j{alternative}"
        raise InputError.one(f"{expected}, found {text!r}") from None


def gains_from_text(robot: Robot, position: str, stiffness: str, *, integral: bool) -> Gains:
    """Return gains that give all joints the same poles.

    Raises:
        InputError: poles are invalid, or their number is not the one that the robot needs.
    """
    return _gains_from_poles(
        robot, {"": parse_poles(position, ", or a YAML file")}, {"": parse_poles(stiffness)}, integral
    )


def load_gains(path: str | os.PathLike[str], robot: Robot, *, integral: bool) -> Gains:
    """Return gains from a file with the poles of each joint.

    Raises:
        InputError: the file has problems.
    """
    document, source = read_document(path, PolesFile, file_formats.POLES)
    poles_by_joint = {joint.name: joint for joint in document.joints}
    for name in poles_by_joint.keys() - set(robot.joint_names):
        hint = did_you_mean(name, robot.joint_names)
        raise InputError.one(f"the robot has no joint {name!r}{hint}", source.path)
    missing = [name for name in robot.joint_names if name not in poles_by_joint]
    if missing:
        raise InputError.one(f"no poles for {', '.join(missing)}; each joint needs them", source.path)
    position, stiffness = (
        {f"{name}: ": parse_poles(getattr(poles_by_joint[name], error)) for name in robot.joint_names}
        for error in ("position", "stiffness")
    )
    try:
        return replace(_gains_from_poles(robot, position, stiffness, integral), sources=(source,))
    except InputError as error:
        raise InputError.one(str(error), source.path) from None


def _gains_from_poles(
    robot: Robot, position: Mapping[str, Poles], stiffness: Mapping[str, Poles], integral: bool
) -> Gains:
    """Return the gains for the poles of each joint, by the beginnings of error messages on them."""
    sprung = any(actuator.sprung for actuator in robot.actuators)
    order = POSITION_ORDER if sprung else RIGID_ORDER
    return Gains.from_poles(
        [
            _repeat_single_pole(message_start, "position", poles, order, integral)
            for message_start, poles in position.items()
        ],
        [
            _repeat_single_pole(message_start, "stiffness", poles, STIFFNESS_ORDER, integral)
            for message_start, poles in stiffness.items()
        ],
    )


def _repeat_single_pole(message_start: str, name: str, poles: Poles, order: int, integral: bool) -> Poles:
    """Return one pole for each state of the error; a single one is repeated."""
    count = order + integral
    if len(poles) == 1:
        return poles * count
    if len(poles) != count:
        alternative = f"{order} without" if integral else f"{order + 1} with"
        expected = (
            f"{message_start}expected {count} poles of the {name} error ({alternative} integral action)"
        )
        raise InputError.one(f"{expected}, or 1 that is repeated, found {len(poles)}")
    return poles
