"""Reading of documents into declared record classes, and changes to them, as of `--set PATH=VALUE`."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any, TypeAlias, TypeVar

from vsacli.base.errors import InputError, Problem
from vsacli.base.units import Quantity
from vsacli.documents.record_checks import DeclaredRecord
from vsacli.documents.record_reader import read_record
from vsacli.documents.source import Problems, Source, read_source, recognizing_other_formats
from vsacli.documents.tree import MapNode, Node, Scope, TextNode, parse_yaml, plain, quoted

_Document = TypeVar("_Document", bound=DeclaredRecord)

Changes: TypeAlias = Mapping[str, Any]
"""Replacements by path into a file, applied in order: values in the form used in files."""

KEPT = ("format", "name", "description")
"""Keys that changes must not touch, since they identify the file."""

_NUMBER = re.compile(r'"([-+]?\.?\d[-+.\w ]*)"')


def read_document(
    path: str | os.PathLike[str],
    cls: type[_Document],
    format_name: str,
    members: Mapping[str, str] | None = None,
    exempt: Mapping[str, Mapping[str, str]] | None = None,
) -> tuple[_Document, Source]:
    """Read a YAML file into a record.

    Args:
        path: path of the file.
        cls: record class of the whole document.
        format_name: required value of the key `format`.
        members: name and unit variant of every joint, if the document has PerJoint values.
        exempt: for purposes of PerJoint values, the joints without a value, each with a reason.

    Raises:
        InputError: with every problem of the file, each with its line.
    """
    with recognizing_other_formats(path):
        expected = f"expected a YAML file that begins with `format: {format_name}`"
        source, text = read_source(path, expected=expected)
        problems = Problems(source.path)
        root = parse_yaml(text, problems)
        if not isinstance(root, MapNode):
            problems.fail(root.line, f"{expected}, found {root}")
        _check_format(root, format_name, problems)
    record = read_record(cls, root, "", Scope(problems, members or {}, exempt or {}), beside=("format",))
    problems.check()
    return record, source


def survey_document(
    path: str | os.PathLike[str], cls: type[DeclaredRecord]
) -> tuple[MapNode, list[tuple[Quantity, Node]]]:
    """Return the root of a YAML file, and its PerJoint values as written, for any joints.

    Args:
        path: path of the file.
        cls: record class of the whole document; its problems are not reported.

    Raises:
        InputError: the file is not a YAML mapping.
    """
    source, text = read_source(path)
    problems = Problems(source.path)
    root = parse_yaml(text, problems)
    if not isinstance(root, MapNode):
        problems.fail(root.line, f"expected a mapping, found {root}")
    survey: list[tuple[Quantity, Node]] = []
    with suppress(InputError):  # too many problems; reading the document reports them
        read_record(cls, root, "", Scope(problems, {}, {}, survey=survey), beside=("format",))
    return root, survey


def _check_format(root: MapNode, expected: str, problems: Problems) -> None:
    node = root.entries.get("format")
    if node is None:
        problems.add(root.line, f"missing key 'format'; the file must begin with `format: {expected}`")
    elif not (isinstance(node, TextNode) and node.text == expected):
        problems.fail(node.line, f"format: expected {expected!r}, found {node}")


class ChangeError(InputError):
    """A change that cannot be applied, as opposed to a fault of the file.

    Attributes:
        change: the change as in `--set PATH=VALUE`.
    """

    def __init__(self, problems: Iterable[Problem], change: str = "") -> None:
        super().__init__(problems)
        self.change = change

    @classmethod
    def of(cls, change: str, message: str) -> ChangeError:
        """Return the error of a change, with a single problem."""
        return cls([Problem("", 0, message)], change)


def read_changes(texts: Iterable[str]) -> dict[str, Any]:
    """Return changes from texts such as `joints.elbow.link.mass=2.5`.

    Raises:
        ChangeError: a text has no `=`, a value is not YAML, or a path is changed twice.
    """
    changes: dict[str, Any] = {}
    texts_by_path: dict[str, str] = {}
    for text in texts:
        path, equals, value_text = (part.strip() for part in text.partition("="))
        if not (path and equals and value_text):
            raise ChangeError.of(text, "expected PATH=VALUE, e.g. joints.*.link.mass=2.5")
        if path in texts_by_path:
            raise ChangeError.of(text, f"{path} is also set to {quoted(texts_by_path[path])}; set it once")
        texts_by_path[path], changes[path] = value_text, _parse_change_value(text, value_text)
    return changes


def format_changes(changes: Changes) -> list[str]:
    """Return changes as texts that `read_changes` accepts."""
    return [f"{path}={_format_change_value(value)}" for path, value in changes.items()]


def _format_change_value(value: Any) -> str:
    """Return a value as YAML: JSON, without the quotes of texts that begin with a digit."""
    return value if isinstance(value, str) else _NUMBER.sub(r"\1", json.dumps(value))


def _parse_change_value(change: str, text: str) -> Any:
    problems = Problems("")
    try:
        node = parse_yaml(text, problems)
        problems.check()
    except InputError as error:
        raise ChangeError.of(change, error.problems[0].message) from None
    return plain(node)


def check_path_of_change(path: str, change: str = "") -> None:
    """Refuse a path to a key that changes must not touch; `change` is as in `ChangeError`.

    Raises:
        ChangeError: the path leads to such a key.
    """
    if (key := path.partition(".")[0]) in KEPT:
        raise ChangeError.of(change, f"the {key} of a file cannot be changed here; edit the file")


def apply_changes(
    document: _Document,
    source: Source,
    changes: Changes,
    members: Mapping[str, str] | None = None,
    exempt: Mapping[str, Mapping[str, str]] | None = None,
) -> tuple[_Document, Source]:
    """Return a document with changes applied, and its source, which stores them.

    Args:
        document: record of declared fields.
        source: file that the document was read from.
        changes: replacements to apply.
        members: as for `read_document`.
        exempt: as for `read_document`.

    Raises:
        ChangeError: the first change that cannot be applied.
    """
    if not changes:
        return document, source
    from vsacli.documents.paths import ReplacementError, replace_all  # 3 % of the start of a run

    for path, change in zip(changes, format_changes(changes), strict=True):
        check_path_of_change(path, change)
    try:
        document = replace_all(document, changes, members, exempt, source.path)
    except ReplacementError as error:
        (change,) = format_changes({error.path: changes[error.path]})
        raise ChangeError(error.problems, change) from None
    return document, source._replace(changes=json.dumps(changes))
