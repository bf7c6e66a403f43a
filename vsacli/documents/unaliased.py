"""YAML text in which what a path leads to stands by itself, not as the alias of something elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import yaml


def unaliased(text: str, paths: Iterable[str]) -> str:
    """The text with aliases written out, of all that some paths lead through.

    Args:
        text: a YAML document that can be read.
        paths: words joined by dots, entries of lists by index; those that lead nowhere do not count.
    """
    ways = [tuple(path.split(".")) for path in paths]
    while True:
        shared = _shared(text, ways)
        if not shared:
            return text
        for start, end, node in sorted(shared, key=lambda alias: alias[0], reverse=True):
            text = text[:start] + _flow(text, node) + text[end:]


def _shared(text: str, ways: Iterable[tuple[str, ...]]) -> list[tuple[int, int, yaml.Node]]:
    """Aliases, from where to where, of nodes that some path leads to or through, and those nodes."""
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    nodes = {node.start_mark.index: node for way in ways for node in _along(root, way)}
    anchors: dict[str, yaml.Node] = {}
    found = []
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        if isinstance(event, yaml.AliasEvent):
            if event.anchor in anchors:
                found.append((*_place(event), anchors[event.anchor]))
        elif isinstance(event, yaml.NodeEvent) and event.anchor and _place(event)[0] in nodes:
            anchors[event.anchor] = nodes[_place(event)[0]]
    return found


def _place(event: yaml.Event) -> tuple[int, int]:
    """From where to where in the text."""
    assert event.start_mark is not None, "as of every event of a text"
    assert event.end_mark is not None, "likewise"
    return event.start_mark.index, event.end_mark.index


def _along(node: yaml.Node | None, way: tuple[str, ...]) -> Iterator[yaml.Node]:
    """The nodes that a path leads through, as far as it goes."""
    for word in way:
        if isinstance(node, yaml.MappingNode):
            node = next((value for key, value in node.value if key.value == word), None)
        elif isinstance(node, yaml.SequenceNode) and word.isdigit() and int(word) < len(node.value):
            node = node.value[int(word)]
        else:
            return
        if node is None:
            return
        yield node


def _flow(text: str, node: yaml.Node) -> str:
    """A node on one line, its scalars as they stand."""
    if isinstance(node, yaml.MappingNode):
        return "{" + ", ".join(f"{key.value}: {_flow(text, value)}" for key, value in node.value) + "}"
    if isinstance(node, yaml.SequenceNode):
        return "[" + ", ".join(_flow(text, value) for value in node.value) + "]"
    own = text[node.start_mark.index : node.end_mark.index]
    return own.partition(" ")[2] if own.startswith("&") else own
