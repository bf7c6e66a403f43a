"""Kinds of files: their recognition, and the JSON Schema of YAML files.

A file is recognized by its content, or by the ending of its name if the content is not conclusive.
"""

from __future__ import annotations

import enum
import os
from pathlib import Path
from typing import Any, NamedTuple

from vsacli.base import file_formats
from vsacli.base.did_you_mean import nearest
from vsacli.base.errors import InputError
from vsacli.base.lazy import import_from
from vsacli.base.storage import place_of
from vsacli.base.version import __version__
from vsacli.documents import tree
from vsacli.documents.source import (
    HDF5_SIGNATURE,
    Problems,
    check_input_file,
    is_table,
    read_source,
    recognizing_other_formats,
)
from vsacli.documents.tree import parse_yaml


class FileKind(enum.StrEnum):
    """Kinds of files that the program reads."""

    ROBOT = "robot"
    TRAJECTORY = "trajectory"
    POLES = "poles"
    TABLE = "table"
    CATALOG = "motor catalog"
    URDF = "urdf"
    RESULT = "result"
    SIMULATION = "simulation"
    STUDY = "study"
    STUDY_TABLE = "table of a study"
    COLUMNS = "columns"


class Document(NamedTuple):
    """A kind of YAML file.

    Attributes:
        format: Value of the key `format`.
        home: Record class of the whole document, "module:name"; imported for its schema only.
        title: Short description.
    """

    format: str
    home: str
    title: str

    @property
    def record(self) -> type:
        """Record class of the whole document."""
        record: type = import_from(self.home)
        return record

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema, draft 2020-12."""
        from vsacli.documents.json_schema import json_schema

        return json_schema(self.record, self.format, self.title)


DOCUMENTS = {
    "robot": Document(file_formats.ROBOT, "vsacli.robot.file:RobotFile", "robot of vsacli"),
    "trajectory": Document(
        file_formats.TRAJECTORY, "vsacli.trajectory.file:OF_ANY_ROBOT", "trajectory of vsacli"
    ),
    "poles": Document(file_formats.POLES, "vsacli.control.poles:PolesFile", "poles of a vsacli controller"),
    "study": Document(file_formats.STUDY, "vsacli.studies.sweeps.study_file:StudyFile", "study of vsacli"),
    "columns": Document(
        file_formats.COLUMNS, "vsacli.documents.columns_file:ColumnsFile", "columns of recordings for vsacli"
    ),
}
"""Kinds of documents, by name."""


CATALOG_COLUMNS = {"name", "inertia"}
"""Required columns of a catalog of motors."""

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
        return FileKind.CATALOG if _is_catalog(path) else FileKind.TABLE
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


def _is_catalog(path: str | os.PathLike[str]) -> bool:
    """Return whether a table has the columns that a motor of a catalog must have."""
    from vsacli.documents.csv_file import read_header, split_heading

    try:
        names = {split_heading(column)[0] for column in read_header(path).columns}
    except InputError:  # reported by the reader of tables
        return False
    return names >= CATALOG_COLUMNS


def _stored_kind(path: str | os.PathLike[str]) -> FileKind:
    from vsacli.results.store.reader import other_version, stored_format

    kinds = {
        file_formats.RESULT: (FileKind.RESULT, "invdyn"),
        file_formats.SIMULATION: (FileKind.SIMULATION, "simulate"),
        file_formats.STUDY_TABLE: (FileKind.STUDY_TABLE, "study"),
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
    if not isinstance(root, tree.MapNode):
        formats = ", ".join(_DOCUMENT_KINDS)
        problems.fail(root.line, f"expected a YAML file that begins with `format:`, one of {formats}")
    node = root.entries.get("format")
    if node is None:
        problems.fail(root.line, f"missing key 'format'; {_beginning_of(root)}")
    word = node.text if isinstance(node, tree.TextNode) else ""
    if word not in _DOCUMENT_KINDS:
        problems.fail(node.line, f"format: {_unknown_format(word, node)}")
    return _DOCUMENT_KINDS[word]


_KEYS = {"joints": "robot", "position": "trajectory"}
"""Keys by which a document without `format` is recognized, and its name."""


def _beginning_of(root: tree.MapNode) -> str:
    """Return what to write at the beginning of a document without `format`, guessed by its keys."""
    guessed = next((DOCUMENTS[word].format for key, word in _KEYS.items() if key in root.entries), None)
    if guessed is not None:
        return f"begin the file with `format: {guessed}`"
    first, *others = _DOCUMENT_KINDS
    return f"begin the file with `format: {first}` (or {', '.join(others)})"


def _unknown_format(word: str, node: tree.Node) -> str:
    """Return the problem of a format: it is newer than this program, or mistyped."""
    name, _, version = word.partition("/")
    known = next((each for each in _DOCUMENT_KINDS if each.partition("/")[0] == name), None)
    if known is not None and version.isdecimal() and int(version) > int(known.partition("/")[2]):
        return f"{word!r} is newer than {known}, which vsacli {__version__} reads; update vsacli"
    near = nearest(word, _DOCUMENT_KINDS)
    hint = f"; did you mean {near!r}?" if near else ""
    return f"expected one of {', '.join(_DOCUMENT_KINDS)}, found {node}{hint}"
