"""What kind of file is this? Its content decides, and the ending of its name where that says nothing."""

from __future__ import annotations

import enum
import os
from pathlib import Path

from vsacli.base.did_you_mean import nearest
from vsacli.base.errors import InputError
from vsacli.documents import tree
from vsacli.documents.problems import Problems
from vsacli.documents.source import HDF5_SIGNATURE, check_input_file, read_source
from vsacli.documents.yaml_tree import parse_yaml
from vsacli.files.schemas import DOCUMENTS
from vsacli.results.store import schema, simulation
from vsacli.results.store.reader import stored_format


class FileKind(enum.StrEnum):
    """The kinds of files that the program reads."""

    ROBOT = "robot"
    TRAJECTORY = "trajectory"
    POLES = "poles"
    TABLE = "table"
    URDF = "urdf"
    RESULT = "result"
    SIMULATION = "simulation"


_STORED = {schema.FORMAT: FileKind.RESULT, simulation.FORMAT: FileKind.SIMULATION}
_WRITTEN = {document.format: FileKind(word) for word, document in DOCUMENTS.items()}
_BEGINNING = 64


def recognise(path: str | os.PathLike[str]) -> FileKind:
    """The kind of a file.

    Raises:
        InputError: it cannot be read, or is none of the kinds.
        StorageError: the operating system refuses to read a result file.
    """
    check_input_file(path)
    start = _beginning(path)
    suffix = Path(path).suffix.lower()
    if start.startswith(HDF5_SIGNATURE) or suffix == ".h5":
        return _stored_kind(path)
    if suffix == ".csv":
        return FileKind.TABLE
    if start.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<"):
        return FileKind.URDF
    return _written_kind(path)


def _beginning(path: str | os.PathLike[str]) -> bytes:
    try:
        with open(path, "rb") as file:
            return file.read(_BEGINNING)
    except OSError as error:
        raise InputError.one(f"cannot be read: {error.strerror}", os.fspath(path)) from None


def _stored_kind(path: str | os.PathLike[str]) -> FileKind:
    found = stored_format(Path(path))
    if found not in _STORED:
        raise InputError.one(
            f"is an HDF5 file, but its format is none of {', '.join(_STORED)}", os.fspath(path)
        )
    return _STORED[found]


def _written_kind(path: str | os.PathLike[str]) -> FileKind:
    source, text = read_source(path)
    problems = Problems(source.path)
    root = parse_yaml(text, problems)
    formats = ", ".join(_WRITTEN)
    node = root.entries.get("format") if isinstance(root, tree.Mapping) else None
    if node is None:
        problems.fail(root.line, f"is no file of vsacli: a YAML file begins with `format:`, one of {formats}")
    word = node.text if isinstance(node, tree.Scalar) else ""
    if word not in _WRITTEN:
        problems.fail(node.line, f"format: expected one of {formats}, found {node}{_meant(word)}")
    return _WRITTEN[word]


def _meant(word: str) -> str:
    near = nearest(word, _WRITTEN)
    return f"; did you mean {near!r}?" if near else ""
