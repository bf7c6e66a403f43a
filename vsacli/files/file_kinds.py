"""Kinds of files: their recognition, and the JSON Schema of YAML files.

A file is recognized by its content, or by the ending of its name if the content is not conclusive.
"""

from __future__ import annotations

import enum
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vsacli.base.did_you_mean import nearest
from vsacli.base.errors import InputError
from vsacli.base.storage import place_of
from vsacli.control import poles
from vsacli.documents import columns_file, tree
from vsacli.documents.json_schema import json_schema
from vsacli.documents.source import (
    HDF5_SIGNATURE,
    Problems,
    check_input_file,
    is_table,
    read_source,
    recognizing_other_formats,
)
from vsacli.documents.tree import parse_yaml
from vsacli.robot import file as robot_file
from vsacli.studies.sweeps import study_file
from vsacli.trajectory import file as trajectory_file


class FileKind(enum.StrEnum):
    """Kinds of files that the program reads."""

    ROBOT = "robot"
    TRAJECTORY = "trajectory"
    POLES = "poles"
    TABLE = "table"
    URDF = "urdf"
    RESULT = "result"
    SIMULATION = "simulation"
    STUDY = "study"
    STUDY_TABLE = "table of a study"
    COLUMNS = "columns"


@dataclass(frozen=True)
class Document:
    """A kind of YAML file.

    Attributes:
        format: value of the key `format`.
        record: record class of the whole document.
        title: short description.
    """

    format: str
    record: type
    title: str

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema, draft 2020-12."""
        return json_schema(self.record, self.format, self.title)


DOCUMENTS = {
    "robot": Document(robot_file.FORMAT, robot_file.RobotFile, "robot of vsacli"),
    "trajectory": Document(trajectory_file.FORMAT, trajectory_file.OF_ANY_ROBOT, "trajectory of vsacli"),
    "poles": Document(poles.FORMAT, poles.PolesFile, "poles of a vsacli controller"),
    "study": Document(study_file.FORMAT, study_file.StudyFile, "study of vsacli"),
    "columns": Document(columns_file.FORMAT, columns_file.ColumnsFile, "columns of recordings for vsacli"),
}
"""Kinds of documents, by name."""


_DOCUMENT_KINDS = {document.format: FileKind(word) for word, document in DOCUMENTS.items()}
_BEGINNING_BYTES = 64


def recognize(path: str | os.PathLike[str]) -> FileKind:
    """Return the kind of a file.

    Raises:
        InputError: the file cannot be read, or is of no known kind.
        StorageError: the operating system refuses to read a result file.
    """
    check_input_file(path)
    start = _beginning(path)
    suffix = Path(path).suffix.lower()
    if start.startswith(HDF5_SIGNATURE) or suffix == ".h5":
        return _stored_kind(path)
    if is_table(path):
        return FileKind.TABLE
    if start.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<"):
        return FileKind.URDF
    with recognizing_other_formats(path):
        return _document_kind(path)


def _beginning(path: str | os.PathLike[str]) -> bytes:
    try:
        with open(place_of(path), "rb") as file:
            return file.read(_BEGINNING_BYTES)
    except OSError as error:
        raise InputError.one(f"cannot be read: {error.strerror}", os.fspath(path)) from None


def _stored_kind(path: str | os.PathLike[str]) -> FileKind:
    from vsacli.results.store import schema, study_table
    from vsacli.results.store.reader import other_version, stored_format

    kinds = {
        schema.FORMAT: (FileKind.RESULT, "invdyn"),
        schema.SIMULATION: (FileKind.SIMULATION, "simulate"),
        study_table.FORMAT: (FileKind.STUDY_TABLE, "study"),
    }
    found = stored_format(Path(path)) or ""
    if found in kinds:
        return kinds[found][0]
    for known, (_, command) in kinds.items():
        if found.startswith(known.partition("/")[0] + "/"):
            raise InputError.one(other_version(found, known, command), os.fspath(path))
    raise InputError.one(f"is an HDF5 file, but its format is not one of {', '.join(kinds)}", os.fspath(path))


def _document_kind(path: str | os.PathLike[str]) -> FileKind:
    source, text = read_source(path)
    problems = Problems(source.path)
    root = parse_yaml(text, problems)
    formats = ", ".join(_DOCUMENT_KINDS)
    node = root.entries.get("format") if isinstance(root, tree.Mapping) else None
    if node is None:
        problems.fail(root.line, f"is no file of vsacli: a YAML file begins with `format:`, one of {formats}")
    word = node.text if isinstance(node, tree.Scalar) else ""
    if word not in _DOCUMENT_KINDS:
        problems.fail(node.line, f"format: expected one of {formats}, found {node}{_hint(word)}")
    return _DOCUMENT_KINDS[word]


def _hint(word: str) -> str:
    """Return a clause with the nearest format; empty if none is close."""
    near = nearest(word, _DOCUMENT_KINDS)
    return f"; did you mean {near!r}?" if near else ""
