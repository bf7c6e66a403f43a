"""Robot files, format `vsacli-robot/1`: reading, and conversion to a `Robot` with standard DH rows."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from vsacli.base import file_formats
from vsacli.base.errors import InputError, check_path
from vsacli.documents.fields import choice, declared_fields
from vsacli.documents.reading import Changes, apply_changes, read_document
from vsacli.documents.record_checks import construct_unchecked
from vsacli.documents.source import Source
from vsacli.robot.model import Robot


@dataclass(frozen=True)
class RobotFile(Robot):
    """The content of a robot file, with rows and link frames in the DH convention that it names."""

    convention: str = choice(
        ("standard", "modified"),
        "Denavit-Hartenberg convention of all rows and link frames; a modified row i holds a_{i-1}, "
        "alpha_{i-1}, d_i, theta_i",
        default="standard",
    )

    def robot(self, source: Source) -> Robot:
        """Return the robot of a source, with standard rows and link frames, converted from modified ones."""
        content = {name: getattr(self, name) for name in declared_fields(Robot)}
        robot = construct_unchecked(Robot, {**content, "sources": (source, *self.spring_sources)})
        if self.convention == "standard":
            return robot
        from vsacli.robot.modified_dh import as_standard

        return as_standard(robot)


def load_robot(path: str | os.PathLike[str], changes: Changes = MappingProxyType({})) -> Robot:
    """Read a robot from a YAML file.

    Args:
        path: path of the file.
        changes: values that override those at paths, e.g. `{"joints.*.link.mass": 2}`; stored in results.

    Raises:
        InputError: the file has problems; lists each with its line.
        TypeError: path is of another type.
    """
    check_path(path, "load_robot(path)")
    return read_robot_file(path).robot(changes)


class RobotFileWithSource(NamedTuple):
    """A robot file that was read: its content, and its source for error messages."""

    document: RobotFile
    source: Source

    def robot(self, changes: Changes = MappingProxyType({})) -> Robot:
        """Return the robot with changes.

        Raises:
            ChangeError: a change cannot be made.
            InputError: the modified rows cannot be converted to standard ones.
        """
        document, source = apply_changes(self.document, self.source, changes)
        try:
            return document.robot(source)
        except InputError as error:
            reason = f"its modified rows have no standard ones: {error}"
            raise InputError.one(reason, source.path) from None


def read_robot_file(path: str | os.PathLike[str]) -> RobotFileWithSource:
    """Read a robot file.

    Raises:
        InputError: the file has problems; lists each with its line.
    """
    return RobotFileWithSource(*read_document(path, RobotFile, file_formats.ROBOT))


def text_to_change(robot: Robot) -> tuple[str, Path]:
    """Return the text of the file that a robot was read from, and the folder of this file.

    Raises:
        InputError: the robot was not read from a file, or its text was too large to keep.
    """
    source = next(iter(robot.sources), None)
    if source is None or source.text is None:
        raise InputError.one(f"{robot.name}: was not read from a file that could be changed")
    return source.text, Path(source.path).parent
