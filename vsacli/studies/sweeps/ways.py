"""How numbers of files vary over a study: the values of `vary:`, by the path to each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import FieldProblem, InputError
from vsacli.documents import tree
from vsacli.documents.changes import check_path_of_change
from vsacli.documents.fields import Kind
from vsacli.documents.records import Check, FieldPath, Refer, Schema
from vsacli.documents.tree import INVALID, Node, Scope
from vsacli.studies.sensitivities.tolerances import SHAPES

SPACED = ("linspace", "logspace")
LINKED, FACTOR = "linked", "factor"
FORMS = (
    "a list of values, {linspace: [first, last, count]}, {logspace: [first, last, count]}, {normal: 5 %}, "
    "{uniform: 5 %}, {uniform: [least, largest]} or {linked: path, factor: 2}"
)


class Listed(NamedTuple):
    """Values one by one, each what the file could hold."""

    values: tuple[Any, ...]


class Spaced(NamedTuple):
    """Numbers from the first to the last, evenly or by equal factors; texts as written."""

    shape: str
    first: str
    last: str
    steps: str


class Drawn(NamedTuple):
    """A distribution, of each number that the path fits by itself; the node is as of `distribution`."""

    node: Node


class Ranged(NamedTuple):
    """Numbers between two, all as likely; texts as written."""

    least: str
    largest: str


class Linked(NamedTuple):
    """The value of another path, or a multiple of it."""

    path: str
    factor: str


Way: TypeAlias = Listed | Spaced | Drawn | Ranged | Linked


class Varied(NamedTuple):
    """A path with its line in the study file, and how what it leads to varies."""

    path: str
    line: int
    way: Way


@dataclass(eq=False)
class Ways(Kind):
    """A mapping from paths into robot or trajectory to how what they lead to varies."""

    words = "mapping from paths to values"

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """A tuple of `Varied`."""
        if not isinstance(node, tree.Mapping):
            return scope.unexpected(node, "a mapping from paths to values", label)
        found = []
        for path, entry in node.entries.items():
            try:
                check_path_of_change(path)
                found.append(Varied(path, node.key_lines[path], _way(entry)))
            except InputError as error:
                message = error.problems[0].message
                scope.problems.add(entry.line, message if message.startswith(path) else f"{path}: {message}")
        return tuple(found) if len(found) == len(node.entries) else INVALID

    def problems(self, _path: FieldPath, _check: Check | None, _content: Any, /) -> Iterator[FieldProblem]:
        """None beyond those of reading."""
        return iter(())

    def schema(self, _check: Check | None, _refer: Refer, /) -> Schema:
        """A mapping of lists and of mappings with one of a few keys."""
        keys = (*SPACED, *SHAPES, LINKED)
        way = {"type": "object", "anyOf": [{"required": [key]} for key in keys]}
        return {"type": "object", "additionalProperties": {"anyOf": [{"type": "array", "minItems": 1}, way]}}

    def json_value(self, content: Any, _of_record: Any, /) -> Any:
        """The ways as texts."""
        return {varied.path: str(varied.way) for varied in content}


def _way(node: Node) -> Way:
    match node:
        case tree.Sequence(items=items) if items:
            return Listed(tuple(map(tree.plain, items)))
        case tree.Mapping(entries=entries) if entries:
            return _mapped(node, dict(entries))
    raise InputError.one(f"expected {FORMS}, found {node}")


def _mapped(node: tree.Mapping, entries: Mapping[str, Node]) -> Way:
    """What a mapping says."""
    key = next(iter(entries))
    if LINKED in entries:
        texts = {word: _text(entry, word) for word, entry in entries.items() if word in (LINKED, FACTOR)}
        if len(texts) == len(entries):
            return Linked(texts[LINKED], texts.get(FACTOR, "1"))
    elif len(entries) == 1 and key in SPACED:
        return Spaced(key, *_texts(entries[key], 3, f"{key}: [first, last, count]"))
    elif len(entries) == 1 and key in SHAPES:
        if key == "uniform" and isinstance(entries[key], tree.Sequence):
            return Ranged(*_texts(entries[key], 2, "uniform: [least, largest]"))
        return Drawn(node)
    hint = did_you_mean(key, [*SPACED, *SHAPES, LINKED]) if len(entries) == 1 else ""
    raise InputError.one(f"expected {FORMS}, found a mapping with {', '.join(entries)}{hint}")


def _texts(node: Node, count: int, form: str) -> list[str]:
    if not isinstance(node, tree.Sequence) or len(node.items) != count:
        raise InputError.one(f"expected {form}, found {node}")
    return [_text(item, form) for item in node.items]


def _text(node: Node, form: str) -> str:
    if not isinstance(node, tree.Scalar):
        raise InputError.one(f"expected a single value in {form}, found {node}")
    return node.text
