"""Edits of the text of a YAML file: new values, expanded aliases and comments; the rest stays as it is."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import yaml
from yaml import MappingNode, Node, ScalarNode

from vsacli.base.errors import InputError
from vsacli.base.texts import for_yaml

__all__ = [
    "MappingNode",
    "Node",
    "ScalarNode",
    "edited",
    "format_on_one_line",
    "moved_files",
    "node_at",
    "root_of",
    "texts_at",
    "unaliased",
    "with_errors",
]

_Words: TypeAlias = tuple[str, ...]
_EARLIER_ERRORS = re.compile(r"(?:\s*#|;) \w+ \+- [^\s,;]+(?:, \w+ \+- [^\s,;]+)*$")


def edited(text: str, values: Mapping[str, Any]) -> str:
    """Return the text with new values at some paths, inserted where a path does not exist yet.

    Args:
        text: valid YAML document.
        values: new texts, numbers, or mappings of these by path, e.g. `joints.0.actuator.branch`; entries of
            lists by index.

    Raises:
        InputError: a path does not exist, or leads through an alias, so that its anchor would change as well.
    """
    root = root_of(text)
    edits = (_locate_edit(root, tuple(path.split(".")), value) for path, value in values.items())
    for start, end, replacement in sorted(edits, reverse=True):
        text = text[:start] + replacement + text[end:]
    return text


def moved_files(text: str, origin: Path, folder: Path) -> Iterator[tuple[str, str]]:
    """Yield path and value of each file named in a document, relative to `folder` instead of `origin`."""
    if os.path.samefile(origin, folder):
        return
    for path, file in texts_at(text, "file"):
        yield path, os.path.relpath(origin / file, folder)


def node_at(root: yaml.Node, path: str) -> yaml.Node | None:
    """Return the node at a path; None if there is none."""
    words = path.split(".")
    nodes = list(_nodes_along(root, words))
    return nodes[-1] if len(nodes) == len(words) else None


def _nodes_along(node: yaml.Node | None, words: Iterable[str]) -> Iterator[yaml.Node]:
    """Yield the nodes along a path, as far as they exist."""
    for word in words:
        node = None if node is None else dict(_children_by_word(node)).get(word)
        if node is None:
            return
        yield node


def texts_at(text: str, key: str) -> Iterator[tuple[str, str]]:
    """Yield path and value of every text under a key, anywhere in a YAML document."""
    yield from _texts_at(root_of(text), key, ())


def root_of(text: str) -> yaml.Node:
    """Return the root node of a valid document."""
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    assert root is not None, "a document that can be read"
    return root


def _texts_at(node: yaml.Node, key: str, path_words: _Words) -> Iterator[tuple[str, str]]:
    for word, entry in _children_by_word(node):
        if word == key and isinstance(entry, yaml.ScalarNode):
            yield ".".join((*path_words, word)), entry.value
        yield from _texts_at(entry, key, (*path_words, word))


def _children_by_word(node: yaml.Node) -> Iterator[tuple[str, yaml.Node]]:
    """Yield the entries of a node, each with the path word that leads to it."""
    if isinstance(node, yaml.MappingNode):
        yield from ((key.value, entry) for key, entry in node.value)
    elif isinstance(node, yaml.SequenceNode):
        yield from ((str(index), entry) for index, entry in enumerate(node.value))


def _locate_edit(root: yaml.Node, words: _Words, value: Any) -> tuple[int, int, str]:
    """Return start and end of a span of the text, and its replacement."""
    *parent_words, key = words
    node = root
    for word in parent_words:
        child = dict(_children_by_word(node)).get(word)
        if child is None:
            raise InputError.one(f"{'.'.join(words)}: there is no {word!r}")
        if not node.start_mark.index <= child.start_mark.index < node.end_mark.index:
            raise InputError.one(f"{'.'.join(words)}: {word!r} is an alias, which others share")
        node = child
    entry = dict(_children_by_word(node)).get(key)
    if entry is not None:
        return _replacement(node, entry, format_on_one_line(value))
    if not isinstance(node, yaml.MappingNode):
        raise InputError.one(f"{'.'.join(words)}: there is no {key!r}")
    return _insertion(node, f"{key}: {format_on_one_line(value)}")


def _replacement(node: yaml.Node, old_node: yaml.Node, new_text: str) -> tuple[int, int, str]:
    """Return the edit that replaces an entry of a node; a block value is replaced from its key on."""
    is_block = isinstance(old_node, yaml.CollectionNode) and not old_node.flow_style
    if is_block and isinstance(node, yaml.MappingNode):
        key = next(key for key, entry in node.value if entry is old_node)
        return key.end_mark.index, _end_of_text(old_node), f": {new_text}"
    return old_node.start_mark.index, _end_of_text(old_node), new_text


def _end_of_text(node: yaml.Node) -> int:
    """Return where the text of a node ends; a block ends with its last entry."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last_entry = node.value[-1]
        return _end_of_text(last_entry[1] if isinstance(last_entry, tuple) else last_entry)
    return node.end_mark.index


def _insertion(node: yaml.MappingNode, entry: str) -> tuple[int, int, str]:
    """Return the edit that inserts an entry before the first one of a mapping."""
    first_mark = node.value[0][0].start_mark
    start = first_mark.index
    return start, start, f"{entry}, " if node.flow_style else f"{entry}\n{' ' * first_mark.column}"


def format_on_one_line(value: Any) -> str:
    """Return a value on one line: identifiers plain, other texts in quotes."""
    match value:
        case Mapping():
            return "{" + ", ".join(f"{key}: {format_on_one_line(each)}" for key, each in value.items()) + "}"
        case str():
            return value if value.isidentifier() else for_yaml(value)
        case list():
            return "[" + ", ".join(map(format_on_one_line, value)) + "]"
    return json.dumps(value)


def unaliased(text: str, paths: Iterable[str]) -> str:
    """Return the text with the aliases along some paths expanded.

    Args:
        text: valid YAML document.
        paths: words joined by dots, entries of lists by index; paths that do not exist are ignored.
    """
    paths_in_words = [tuple(path.split(".")) for path in paths]
    while True:
        aliases = _aliases_along(text, paths_in_words)
        if not aliases:
            return text
        for start, end, node in sorted(aliases, key=lambda alias: alias[0], reverse=True):
            text = text[:start] + _flow_style(text, node) + text[end:]


def _aliases_along(text: str, paths: Iterable[tuple[str, ...]]) -> list[tuple[int, int, yaml.Node]]:
    """Return start, end and node of each alias whose node lies on one of the paths."""
    root = root_of(text)
    nodes = {node.start_mark.index: node for path in paths for node in _nodes_along(root, path)}
    anchors: dict[str, yaml.Node] = {}
    aliases = []
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        if isinstance(event, yaml.AliasEvent):
            if event.anchor in anchors:
                aliases.append((*_event_span(event), anchors[event.anchor]))
        elif isinstance(event, yaml.NodeEvent) and event.anchor and _event_span(event)[0] in nodes:
            anchors[event.anchor] = nodes[_event_span(event)[0]]
    return aliases


def _event_span(event: yaml.Event) -> tuple[int, int]:
    """Return start and end of an event in the text."""
    assert event.start_mark is not None, "as of every event of a text"
    assert event.end_mark is not None, "likewise"
    return event.start_mark.index, event.end_mark.index


def _flow_style(text: str, node: yaml.Node) -> str:
    """Return a node on one line, with its scalars as written."""
    if isinstance(node, yaml.MappingNode):
        return "{" + ", ".join(f"{key.value}: {_flow_style(text, value)}" for key, value in node.value) + "}"
    if isinstance(node, yaml.SequenceNode):
        return "[" + ", ".join(_flow_style(text, value) for value in node.value) + "]"
    node_text = text[node.start_mark.index : node.end_mark.index]
    return node_text.partition(" ")[2] if node_text.startswith("&") else node_text


def with_errors(text: str, errors: Mapping[str, str]) -> str:
    """Return the text with comments such as `k +- 0.4` on the lines of the numbers at some paths.

    Args:
        text: valid YAML document.
        errors: errors by path, entries of lists by index; paths that do not exist are ignored.
    """
    root = root_of(text)
    remarks_by_line: dict[int, list[str]] = {}
    for path, error in errors.items():
        *_, key = path.split(".")
        node = node_at(root, path)
        if node is not None:
            remarks_by_line.setdefault(node.start_mark.line, []).append(f"{key} +- {error}")
    lines = text.split("\n")
    content_ends = _content_ends(text)
    for line_number, remarks in remarks_by_line.items():
        line = _EARLIER_ERRORS.sub("", lines[line_number].rstrip())
        separator = "; " if "#" in line[content_ends[line_number] :] else "  # "
        lines[line_number] = line + separator + ", ".join(remarks)
    return "\n".join(lines)


def _content_ends(text: str) -> dict[int, int]:
    """Return the column in which the last token of each line ends, after which a comment may follow."""
    ends: dict[int, int] = {}
    for token in yaml.scan(text, Loader=yaml.SafeLoader):
        ends[token.end_mark.line] = max(ends.get(token.end_mark.line, 0), token.end_mark.column)
    return ends
