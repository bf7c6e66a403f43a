"""Changes to a document after it was read: other values at paths into it, as of `--set PATH=VALUE`."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias, TypeVar

from vsacli.base.errors import InputError
from vsacli.documents import tree
from vsacli.documents.source import Problems, Source
from vsacli.documents.yaml_tree import parse_yaml

Changes: TypeAlias = Mapping[str, Any]
"""Values by paths into a file, made in turn: what the file could hold there, in lists, mappings and texts."""

KEPT = ("format", "name", "description")
"""Keys of a document that no change reaches: they say what the file is, which a change does not."""

_NUMBER = re.compile(r'"([-+]?\.?\d[-+.\w ]*)"')
_Document = TypeVar("_Document")


class ChangeError(InputError):
    """A change that cannot be made, rather than a fault of the file."""


def read_changes(texts: Iterable[str]) -> dict[str, Any]:
    """Changes from texts such as `joints.elbow.link.mass=2.5`; what is set twice counts as set last.

    Raises:
        ChangeError: a text has no `=`, a path is one of those that are kept, or a value is no YAML.
    """
    changes: dict[str, Any] = {}
    for text in texts:
        path, equals, written = (part.strip() for part in text.partition("="))
        if not (path and equals and written):
            raise ChangeError.one(f"expected PATH=VALUE, e.g. joints.*.link.mass=2.5, found {text!r}")
        changes.pop(path, None)
        changes[path] = _value(path, written)
    return changes


def written(changes: Changes) -> list[str]:
    """Changes as texts from which `read_changes` has them."""
    return [f"{path}={_text(value)}" for path, value in changes.items()]


def _text(value: Any) -> str:
    """A value as YAML: as JSON, of whose texts those that begin with a digit need no quotes."""
    return value if isinstance(value, str) else _NUMBER.sub(r"\1", json.dumps(value))


def _value(path: str, text: str) -> Any:
    problems = Problems("")
    try:
        node = parse_yaml(text, problems)
        problems.check()
    except InputError as error:
        raise ChangeError.one(f"{path}: {error.problems[0].message}") from None
    return tree.plain(node)


def check_path_of_change(path: str) -> None:
    """Refuse a path into what is kept.

    Raises:
        ChangeError: it is one.
    """
    if path.partition(".")[0] in KEPT:
        raise ChangeError.one(f"{path} says what the file is and stays; change the file itself")


def changed(
    document: _Document,
    source: Source,
    changes: Changes,
    members: Mapping[str, str] | None = None,
    exempt: Mapping[str, Mapping[str, str]] | None = None,
) -> tuple[_Document, Source]:
    """A document with changes, and its file, which remembers them.

    Args:
        document: a record of declared fields.
        source: the file that it was read from.
        changes: the changes.
        members: as of `read_document`.
        exempt: likewise.

    Raises:
        ChangeError: the first that cannot be made.
    """
    from vsacli.documents.paths import replace

    for path, value in changes.items():
        check_path_of_change(path)
        try:
            document = replace(document, path, value, members, exempt, source.path)
        except InputError as error:
            raise ChangeError(error.problems) from None
    return document, source._replace(changes=json.dumps(changes)) if changes else source
