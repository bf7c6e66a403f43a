"""The kinds of YAML files, and their JSON Schemas."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from vsacli.control import poles
from vsacli.documents.json_schema import json_schema
from vsacli.robot import file as robot_file
from vsacli.trajectory import file as trajectory_file


@dataclass(frozen=True)
class Document:
    """A kind of YAML file.

    Attributes:
        format: what its key `format` says.
        record: the record class of the whole document.
        title: a few words.
    """

    format: str
    record: type
    title: str

    def schema(self) -> dict[str, Any]:
        """Its JSON Schema, draft 2020-12."""
        return json_schema(self.record, self.format, self.title)


DOCUMENTS = {
    "robot": Document(robot_file.FORMAT, robot_file.RobotFile, "robot of vsacli"),
    "trajectory": Document(trajectory_file.FORMAT, trajectory_file.OF_ANY_ROBOT, "trajectory of vsacli"),
    "poles": Document(poles.FORMAT, poles.PolesFile, "poles of a vsacli controller"),
}
"""By the word for the kind."""
