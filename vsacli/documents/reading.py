"""Reading a document into the record classes declared with `vsacli.documents.fields`."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from contextlib import suppress
from typing import Any, TypeVar

from vsacli.base.did_you_mean import did_you_mean, nearest
from vsacli.base.errors import InputError, InvalidRecordError
from vsacli.base.units import Quantity
from vsacli.documents import tree
from vsacli.documents.fields import (
    REQUIRED,
    Field,
    Items,
    OneOf,
    Pair,
    PerJoint,
    Record,
    declared,
    field_problems,
    repeated,
    unknown_word,
)
from vsacli.documents.problems import Problems
from vsacli.documents.source import Source, read_source
from vsacli.documents.values import INVALID, Scope, all_valid, read_value, unexpected
from vsacli.documents.yaml_tree import parse_yaml

__all__ = ["read_document", "read_value", "survey_document"]

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
    source, text = read_source(path)
    problems = Problems(source.path)
    root = parse_yaml(text, problems)
    if not isinstance(root, tree.Mapping):
        problems.fail(root.line, f"expected a mapping that begins with `format: {format_name}`, found {root}")
    _check_format(root, format_name, problems)
    record = _read_record_of(cls, root, "", Scope(problems, members or {}, exempt or {}), beside=("format",))
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
        _read_record_of(cls, root, "", Scope(problems, {}, {}, survey=survey), beside=("format",))
    return root, survey


def _check_format(root: tree.Mapping, expected: str, problems: Problems) -> None:
    node = root.entries.get("format")
    if node is None:
        problems.add(root.line, f"missing key 'format'; the file must begin with `format: {expected}`")
    elif not (isinstance(node, tree.Scalar) and node.text == expected):
        problems.fail(node.line, f"format: expected {expected!r}, found {node}")


def _read_record_of(
    cls: type, node: tree.Mapping, label: str, scope: Scope, beside: tuple[str, ...] = ()
) -> Any:
    """Read a mapping; the keys `beside` those of the class are the caller's."""
    prefix = f"{label}: " if label else ""
    scope = scope.inside(cls, node)
    fields = declared(cls)
    mistyped = _refuse_unknown_keys(cls, node, (*fields, *beside), scope)
    values = {
        name: _read_field(name, field, node, prefix, scope)
        for name, (field, default) in fields.items()
        if name in node.entries or (default is REQUIRED and name not in mistyped)
    }
    if INVALID in values.values() or not mistyped.isdisjoint(fields):
        return INVALID
    try:
        return cls(**values)
    except InvalidRecordError as error:
        for problem in error.fields:
            message = problem.in_file(list(scope.members))
            scope.problems.add(_line_of(problem.path, node, scope), f"{prefix}{message}")
        return INVALID
    except InputError as error:
        scope.problems.include(error)
        return INVALID


def _refuse_unknown_keys(cls: type, node: tree.Mapping, known: Collection[str], scope: Scope) -> set[str]:
    """Note unknown keys; returns the known ones that were probably meant, which are then not missing."""
    meant: set[str] = set()
    for key, line in node.key_lines.items():
        if key in getattr(cls, "not_yet", ()):
            scope.problems.add(line, f"{key!r} is not supported yet")
        elif key not in known:
            scope.problems.add(line, f"unknown key {tree.quoted(key)}{did_you_mean(key, known)}")
            meant.update(filter(None, [nearest(key, known)]))
    return meant - node.entries.keys()


def _read_field(name: str, field: Field, node: tree.Mapping, prefix: str, scope: Scope) -> Any:
    content = node.entries.get(name)
    if content is None:
        scope.problems.add(node.line, f"{prefix}missing key {name!r} ({field.doc})")
        return INVALID
    value = read_value(field.kind, content, name, scope)
    if value is INVALID:
        return INVALID
    problems = list(field_problems(name, field, value))
    for problem in problems:
        place = _joint_of(problem.path, field, scope)
        scope.problems.add(_line_of(problem.path, node, scope), f"{name}{place}: {problem.message}")
    return INVALID if problems else value


def _joint_of(path: tuple[str | int, ...], field: Field, scope: Scope) -> str:
    match field.kind:
        case PerJoint() | Items(PerJoint()):
            return f" of joint {list(scope.members)[int(path[-1])]}"
    return ""


def _line_of(path: tuple[str | int, ...], node: tree.Node, scope: Scope) -> int:
    """The line of the deepest node on the way along a path; a scalar stands for all entries of its value."""
    for step in path:
        if isinstance(node, tree.Mapping):
            key = list(scope.members)[step] if isinstance(step, int) else step
            if key not in node.entries:
                break
            node = node.entries[key]
        elif isinstance(node, tree.Sequence) and isinstance(step, int):
            node = node.items[step]
    return node.line


@read_value.register(Record)
def _read_record(kind: Record, node: tree.Node, label: str, scope: Scope) -> Any:
    if isinstance(node, tree.Mapping):
        return _read_record_of(kind.cls, node, label, scope)
    return unexpected(node, "a mapping", label, scope)


@read_value.register(OneOf)
def _read_one_of(kind: OneOf, node: tree.Node, label: str, scope: Scope) -> Any:
    if not isinstance(node, tree.Mapping):
        return unexpected(node, "a mapping with the key 'type'", label, scope)
    selector = node.entries.get("type")
    if selector is None:
        scope.problems.add(node.line, f"{label}: missing key 'type', one of {', '.join(kind.variants)}")
        return INVALID
    if not isinstance(selector, tree.Scalar):
        return unexpected(selector, f"one of {', '.join(kind.variants)}", f"{label}.type", scope)
    if selector.text not in kind.variants:
        reason = unknown_word(selector.text, kind.variants, kind.not_yet)
        scope.problems.add(selector.line, f"{label}.type: {reason}")
        return INVALID
    return _read_record_of(kind.variants[selector.text], node, label, scope, beside=("type",))


@read_value.register(Items)
def _read_items(kind: Items, node: tree.Node, label: str, scope: Scope) -> Any:
    if not isinstance(node, tree.Sequence) or not node.items:
        return unexpected(node, "a list of one or more", label, scope)
    values = all_valid([read_value(kind.item, item, label, scope) for item in node.items])
    return INVALID if _note_repeated(kind, node, label, scope) else values


def _note_repeated(kind: Items, node: tree.Sequence, label: str, scope: Scope) -> bool:
    if kind.unique is None:
        return False
    keys = [_scalar_entry(item, kind.unique) for item in node.items]
    found = list(repeated(key.text if key else None for key in keys))
    for index, message in found:
        line = _line_of((index, kind.unique), node, scope)
        scope.problems.add(line, f"{label}.{kind.unique}: {message}")
    return bool(found)


def _scalar_entry(node: tree.Node, key: str) -> tree.Scalar | None:
    entry = node.entries.get(key) if isinstance(node, tree.Mapping) else None
    return entry if isinstance(entry, tree.Scalar) else None


@read_value.register(Pair)
def _read_pair(kind: Pair, node: tree.Node, label: str, scope: Scope) -> Any:
    if not isinstance(node, tree.Sequence):
        both = read_value(kind.item, node, label, scope)
        return both if both is INVALID else (both, both)
    if len(node.items) != 2:
        return unexpected(node, "one value for both sides or a list of 2", label, scope)
    return all_valid([read_value(kind.item, item, label, scope) for item in node.items])
