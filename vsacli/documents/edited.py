"""The text of a YAML file with other values in it; comments and layout stay as they are."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import yaml
from yaml import MappingNode, Node, ScalarNode

from vsacli.base.errors import InputError
from vsacli.base.texts import for_yaml

__all__ = ["MappingNode", "Node", "ScalarNode", "edited", "moved_files", "node_at", "root_of", "texts_at"]

_Words: TypeAlias = tuple[str, ...]


def edited(text: str, values: Mapping[str, Any]) -> str:
    """The text with other values at some paths, or put in where there is none.

    Args:
        text: a YAML document that can be read.
        values: new texts, numbers, or mappings of these by path, e.g. `joints.0.actuator.preload`; entries of
            lists by index.

    Raises:
        InputError: a path leads nowhere, or through an alias, so that its anchor would change as well.
    """
    root = root_of(text)
    edits = (_edit(root, tuple(path.split(".")), value) for path, value in values.items())
    for start, end, replacement in sorted(edits, reverse=True):
        text = text[:start] + replacement + text[end:]
    return text


def moved_files(text: str, origin: Path, folder: Path) -> Iterator[tuple[str, str]]:
    """Path and value of every file that a document in a folder names, as seen from another folder."""
    if os.path.samefile(origin, folder):
        return
    for path, file in texts_at(text, "file"):
        yield path, os.path.relpath(origin / file, folder)


def node_at(root: yaml.Node, path: str) -> yaml.Node | None:
    """What stands at a path; None if it leads nowhere."""
    node: yaml.Node | None = root
    for word in path.split("."):
        node = None if node is None else dict(_entries(node)).get(word)
    return node


def texts_at(text: str, key: str) -> Iterator[tuple[str, str]]:
    """Path and value of every text under a key, wherever in a YAML document."""
    yield from _texts_at(root_of(text), key, ())


def root_of(text: str) -> yaml.Node:
    """The nodes of a document that can be read."""
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    assert root is not None, "a document that can be read"
    return root


def _texts_at(node: yaml.Node, key: str, place: _Words) -> Iterator[tuple[str, str]]:
    for word, entry in _entries(node):
        if word == key and isinstance(entry, yaml.ScalarNode):
            yield ".".join((*place, word)), entry.value
        yield from _texts_at(entry, key, (*place, word))


def _entries(node: yaml.Node) -> Iterator[tuple[str, yaml.Node]]:
    """The words of a path that lead on from a node, and where to."""
    if isinstance(node, yaml.MappingNode):
        yield from ((key.value, entry) for key, entry in node.value)
    elif isinstance(node, yaml.SequenceNode):
        yield from ((str(index), entry) for index, entry in enumerate(node.value))


def _edit(root: yaml.Node, words: _Words, value: Any) -> tuple[int, int, str]:
    """From where to where the text becomes what."""
    *way, key = words
    node = root
    for word in way:
        found = dict(_entries(node)).get(word)
        if found is None:
            raise InputError.one(f"{'.'.join(words)}: there is no {word!r}")
        if not node.start_mark.index <= found.start_mark.index < node.end_mark.index:
            raise InputError.one(f"{'.'.join(words)}: {word!r} is an alias, which others share")
        node = found
    here = dict(_entries(node)).get(key)
    if here is not None:
        return _replacement(node, here, _written(value))
    if not isinstance(node, yaml.MappingNode):
        raise InputError.one(f"{'.'.join(words)}: there is no {key!r}")
    return _insertion(node, f"{key}: {_written(value)}")


def _replacement(node: yaml.Node, here: yaml.Node, written: str) -> tuple[int, int, str]:
    """A text in place of an entry of a node; behind the key if that is a block of lines."""
    block = isinstance(here, yaml.CollectionNode) and not here.flow_style
    if block and isinstance(node, yaml.MappingNode):
        key = next(key for key, entry in node.value if entry is here)
        return key.end_mark.index, _end(here), f": {written}"
    return here.start_mark.index, _end(here), written


def _end(node: yaml.Node) -> int:
    """Where the text of a node ends: a block that of its last entry, before what follows on that line."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        return _end(last[1] if isinstance(last, tuple) else last)
    return node.end_mark.index


def _insertion(node: yaml.MappingNode, entry: str) -> tuple[int, int, str]:
    """A further entry before the first one of a mapping."""
    first = node.value[0][0].start_mark
    start = first.index
    return start, start, f"{entry}, " if node.flow_style else f"{entry}\n{' ' * first.column}"


def _written(value: Any) -> str:
    """A value on one line: words plain, other texts in quotes."""
    match value:
        case Mapping():
            return "{" + ", ".join(f"{key}: {_written(each)}" for key, each in value.items()) + "}"
        case str():
            return value if value.isidentifier() else for_yaml(value)
        case list():
            return "[" + ", ".join(map(_written, value)) + "]"
    return json.dumps(value)
