"""Reading a document into the record classes declared with `vsacli.documents.fields`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from typing import TypeVar

from vsacli.base.errors import InputError
from vsacli.base.units import Quantity
from vsacli.documents import tree
from vsacli.documents.kinds.nested import read_record
from vsacli.documents.other_formats import recognising_other_formats
from vsacli.documents.source import Problems, Source, read_source
from vsacli.documents.tree import Scope
from vsacli.documents.yaml_tree import parse_yaml

_Document = TypeVar("_Document")


def read_document(
    path: str | os.PathLike[str],
    cls: type[_Document],
    format_name: str,
    members: Mapping[str, str] | None = None,
    exempt: Mapping[str, Mapping[str, str]] | None = None,
) -> tuple[_Document, Source]:
    """Read a YAML file into a record.

    Args:
        path: the file.
        cls: the record class of the whole document.
        format_name: what its key `format` has to say.
        members: name and unit variant of every joint, where the document has PerJoint values.
        exempt: for a purpose of PerJoint values the joints that have none, each with a clause about it.

    Raises:
        InputError: with every problem of the file, each with its line.
    """
    with recognising_other_formats(path):
        source, text = read_source(path)
        problems = Problems(source.path)
        root = parse_yaml(text, problems)
        if not isinstance(root, tree.Mapping):
            beginning = f"`format: {format_name}`"
            problems.fail(root.line, f"expected a mapping that begins with {beginning}, found {root}")
        _check_format(root, format_name, problems)
    record = read_record(cls, root, "", Scope(problems, members or {}, exempt or {}), beside=("format",))
    problems.check()
    return record, source


def survey_document(
    path: str | os.PathLike[str], cls: type
) -> tuple[tree.Mapping, list[tuple[Quantity, tree.Node]]]:
    """The root of a YAML file, and its PerJoint values as written, whatever joints they are for.

    Args:
        path: the file.
        cls: the record class of the whole document; what is wrong with it is not looked at.

    Raises:
        InputError: the file is no YAML mapping.
    """
    source, text = read_source(path)
    problems = Problems(source.path)
    root = parse_yaml(text, problems)
    if not isinstance(root, tree.Mapping):
        problems.fail(root.line, f"expected a mapping, found {root}")
    survey: list[tuple[Quantity, tree.Node]] = []
    with suppress(InputError):  # too many problems, which reading will report
        read_record(cls, root, "", Scope(problems, {}, {}, survey=survey), beside=("format",))
    return root, survey


def _check_format(root: tree.Mapping, expected: str, problems: Problems) -> None:
    node = root.entries.get("format")
    if node is None:
        problems.add(root.line, f"missing key 'format'; the file must begin with `format: {expected}`")
    elif not (isinstance(node, tree.Scalar) and node.text == expected):
        problems.fail(node.line, f"format: expected {expected!r}, found {node}")
