"""Records written as robot files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from vsacli.documents.fields import declared
from vsacli.robot.file import FORMAT
from vsacli.robot.model import Robot


def fields(record: Any) -> dict[str, Any]:
    """The declared fields of a record that differ from their defaults, as plain values."""
    return {
        name: field.kind.json_value(content, fields)
        for name, (field, default) in declared(type(record)).items()
        if (content := getattr(record, name)) is not None and content != default
    }


def write_robot(robot: Robot, path: Path) -> None:
    """Write a robot file, without the paths of tables."""
    path.write_text(yaml.safe_dump({"format": FORMAT, **fields(robot)}))
