"""Records written as robot files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from vsacli import Robot
from vsacli.base import file_formats
from vsacli.documents.fields import declared_fields
from vsacli.documents.record_values import value_as_json
from vsacli.documents.table import CsvTable


def fields(record: Any) -> dict[str, Any]:
    """The declared fields of a record that differ from their defaults, as plain values."""
    return {
        name: value_as_json(field.kind, content, fields)
        for name, (field, default) in declared_fields(type(record)).items()
        if (content := getattr(record, name)) is not None and content != default
    }


def tables(content: Any) -> Iterator[CsvTable]:
    """The tables in a record, wherever they are."""
    if isinstance(content, CsvTable):
        yield content
    elif isinstance(content, tuple):
        for each in content:
            yield from tables(each)
    elif is_dataclass(content):
        for name in declared_fields(type(content)):
            yield from tables(getattr(content, name))


def write_robot(robot: Robot, path: Path) -> None:
    """Write a robot file, and its tables where their paths are relative to it."""
    path.write_text(yaml.safe_dump({"format": file_formats.ROBOT, **fields(robot)}))
    for table in tables(robot):
        header = ",".join(table.columns)
        np.savetxt(
            path.parent / table.source.path, table.values, "%.17g", delimiter=",", header=header, comments=""
        )
