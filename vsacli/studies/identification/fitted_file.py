"""The robot's file with the numbers that were found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vsacli.base.errors import InputError
from vsacli.documents.edited import edited, moved_files
from vsacli.documents.remarks import with_errors
from vsacli.documents.unaliased import unaliased
from vsacli.robot.model import Robot
from vsacli.studies.identification.identification_report import Identification, Number, significant
from vsacli.studies.sensitivities.parameters import JOINTS, parameters


def fitted_text(robot: Robot, found: Identification, folder: str | Path) -> str:
    """The text of the robot's file with the numbers found, their standard errors behind them as comments.

    Everything else, comments too, stays as the user wrote it; paths lead to the same files. Friction that the
    file has none of is put in where it was found.

    Args:
        robot: as it was read from its file.
        found: what was identified.
        folder: where the text will stand.

    Raises:
        InputError: the robot was not read from a file.
    """
    source = next(iter(robot.sources), None)
    if source is None or source.text is None:
        raise InputError.one(f"{robot.name}: was not read from a file that could be changed")
    known = set(map(str, parameters(robot)))
    values: dict[str, Any] = {}
    errors: dict[str, str] = {}
    for number in found.numbers:
        if not number.told or (number.path not in known and not number.changed):
            continue
        path, value = _indexed(robot, number), float(significant(number.value, number.standard_error))
        errors[path] = f"{number.standard_error:.2g}"
        if number.path in known:
            values[path] = value
        else:
            parent, _, key = path.rpartition(".")
            values.setdefault(parent, {"coulomb": 0.0})[key] = value
    files = dict(moved_files(source.text, Path(source.path).parent, Path(folder)))
    text = edited(unaliased(source.text, values), {**values, **files})
    return with_errors(text, errors)


def _indexed(robot: Robot, number: Number) -> str:
    """The path of a number with its joint by index, as the text has it."""
    _, joint, *rest = number.path.split(".")
    return ".".join((JOINTS, str(robot.joint_names.index(joint)), *rest))
