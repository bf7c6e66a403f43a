"""The robot's file with the numbers that were found."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from vsacli.base.errors import InputError
from vsacli.documents.edited import edited, moved_files, texts_at
from vsacli.documents.remarks import with_errors
from vsacli.documents.unaliased import unaliased
from vsacli.robot.model import Robot
from vsacli.robot.modified_dh import modified_link
from vsacli.robot.parameters import JOINTS, parameters
from vsacli.studies.identification.identification_report import (
    Identification,
    Number,
    SystemReport,
    significant,
)

NOTHING = 1e-9
"""Size of numbers of links, SI units, that are left by rounding."""


def to_write(robot: Robot, systems: Iterable[SystemReport]) -> Iterator[Number]:
    """The numbers that a file with what was found holds: of friction that it has none of, what was found."""
    known = set(map(str, parameters(robot)))
    for number in (number for system in systems for number in system.numbers):
        if number.told and not number.sum and (number.path in known or number.changed):
            yield number


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
    for number in to_write(robot, found.systems):
        path, value = _indexed(robot, number), float(significant(number.value, number.standard_error))
        errors[path] = f"{number.standard_error:.2g}"
        if number.value == number.before:
            continue
        if number.path in known:
            values[path] = value
        else:
            parent, _, key = path.rpartition(".")
            values.setdefault(parent, {"coulomb": 0.0})[key] = value
    values |= _changed_links(robot, found.fitted, source.text)
    files = dict(moved_files(source.text, Path(source.path).parent, Path(folder)))
    text = edited(unaliased(source.text, values), {**values, **files})
    return with_errors(text, errors)


def _changed_links(robot: Robot, fitted: Robot, text: str) -> dict[str, Any]:
    """Numbers of links by path, in frames of the file's convention, of those that are not as they were."""
    modified = dict(texts_at(text, "convention")).get("convention") == "modified"
    found: dict[str, Any] = {}
    for index, (joint, before) in enumerate(zip(fitted.joints, robot.joints, strict=True)):
        if joint.link != before.link:
            link = modified_link(joint) if modified else joint.link
            place = f"{JOINTS}.{index}.link"
            found[f"{place}.mass"] = _rounded(link.mass)
            found[f"{place}.com"] = [_rounded(each) for each in link.com]
            found[f"{place}.inertia"] = {key: _rounded(value) for key, value in vars(link.inertia).items()}
    return found


def _rounded(value: float) -> float:
    """With more digits than records tell, so that links stay bodies, but for what is nothing in any unit."""
    return 0.0 if abs(value) < NOTHING else float(f"{value:.7g}")


def _indexed(robot: Robot, number: Number) -> str:
    """The path of a number with its joint by index, as the text has it."""
    _, joint, *rest = number.path.split(".")
    return ".".join((JOINTS, str(robot.joint_names.index(joint)), *rest))
