"""The tree of a YAML document: texts, lists and mappings with their lines, and the context of their meaning.

YAML is parsed only here, without the implicit types of YAML 1.1. The tree is built from parser events without
recursion, and every scalar stays a text: nothing is resolved (`on`, `1:30`, `010`) and no object is
constructed. Plain anchors and aliases are supported.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple, NoReturn, TypeAlias

import yaml

from vsacli.base.did_you_mean import nearest
from vsacli.base.texts import counted
from vsacli.base.units import Quantity
from vsacli.documents.source import Problems

MAX_SHOWN = 40
MAX_LEVELS = 20
TOO_DEEP = f"nested more than {MAX_LEVELS} levels deep"
MAX_NODES = 100_000
"""Maximum number of keys and values after expansion of aliases."""

_LOADER: type = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_PLAIN = re.compile("[\t\n\r -~]*")
_UNPRINTABLE = "[^\t\n\r -~\x85\xa0-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]"  # slow to compile
_CORE_TAG = "tag:yaml.org,2002:"


def quoted(text: str) -> str:
    """Return a text from a document in quotes, for messages; long texts are truncated."""
    return repr(text) if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]!r}..."


NULLS = frozenset({"", "~", "null"})
"""Texts without quotes that stand for nothing, in lower case."""


class TextNode(NamedTuple):
    """A text as written.

    Attributes:
        line: line number from 1.
        text: content.
        plain: whether it stands without quotes.
        noted: whether it stands for a value whose problem was noted while parsing, an undefined alias.
    """

    line: int
    text: str
    plain: bool
    noted: bool = False

    def __str__(self) -> str:
        return "nothing" if self.is_null else quoted(self.text)

    @property
    def is_null(self) -> bool:
        """Whether the value is absent."""
        return self.plain and self.text.lower() in NULLS


class ListNode(NamedTuple):
    """A list."""

    line: int
    items: tuple[Node, ...]

    def __str__(self) -> str:
        return f"a list of {counted(len(self.items), 'value')}" if self.items else "an empty list"


class MapNode(NamedTuple):
    """Keys with their lines and values, in the order of the file."""

    line: int
    entries: Mapping[str, Node]
    key_lines: Mapping[str, int]

    def __str__(self) -> str:
        return "a mapping" if self.entries else "an empty mapping"


Node: TypeAlias = TextNode | ListNode | MapNode
"""A node of a document; its string completes "found ..." in messages. Aliases share one node."""


def plain(node: Node) -> Any:
    """Return a node as plain data: texts as written; unquoted null, true and false as Python values."""
    match node:
        case MapNode(entries=entries):
            return {key: plain(entry) for key, entry in entries.items()}
        case ListNode(items=items):
            return [plain(item) for item in items]
        case TextNode(text="true" | "false" as word, plain=True):
            return word == "true"
    return None if node.is_null else node.text


INVALID: Final = object()
"""Placeholder of an invalid value whose problem has been noted."""


class Scope(NamedTuple):
    """The context on which the meaning of a value depends.

    Attributes:
        problems: collector of problems.
        members: name and unit variant of every joint, for PerJoint values.
        exempt: for purposes of PerJoint values, the joints without a value, each with the reason.
        variant: choice that determines the units here, None while it is unknown.
        survey: list that collects quantity and node of each PerJoint value instead of reading it; None to
            read.
    """

    problems: Problems
    members: Mapping[str, str]
    exempt: Mapping[str, Mapping[str, str]]
    variant: str | None = None
    survey: list[tuple[Quantity, Node]] | None = None

    def of_member(self, name: str) -> Scope:
        """Return the scope of the value of one joint; the same scope if the name is unknown."""
        return self._replace(variant=self.members.get(name, self.variant))

    def unexpected(self, node: Node, expected: str, label: str, reason: str = "") -> Any:
        """Note that something else than expected was found, unless noted before, and return INVALID."""
        if isinstance(node, TextNode) and node.noted:
            return INVALID
        self.problems.add(node.line, f"{label}: expected {expected}, found {node}{reason}")
        return INVALID


def all_valid(values: Iterable[Any]) -> Any:
    """Return the values as a tuple, or INVALID if one is; all are read, so that each problem is noted."""
    everything = tuple(values)
    return INVALID if INVALID in everything else everything


def parse_yaml(text: str, problems: Problems) -> Node:
    """Parse a document.

    Args:
        text: the YAML text.
        problems: collector of problems after which reading continues: tags, merge keys, duplicate keys,
            unknown aliases.

    Raises:
        InputError: reading ended (broken syntax, beyond the limits, no document); with all problems found
            before.
    """
    unprintable = None if _PLAIN.fullmatch(text) else re.search(_UNPRINTABLE, text)
    if unprintable:
        line = text.count("\n", 0, unprintable.start()) + 1
        problems.fail(
            line, f"the character U+{ord(unprintable[0]):04X} is not allowed in YAML; is this a text file?"
        )
    builder = _TreeBuilder(problems)
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            builder.add_event(event)
    except yaml.MarkedYAMLError as error:
        _fail_with_syntax(error, text, problems)
    if builder.root is None:
        problems.fail(1, "has only comments, no values")
    return builder.root


def _fail_with_syntax(error: yaml.MarkedYAMLError, text: str, problems: Problems) -> NoReturn:
    mark, start = error.problem_mark, error.context_mark
    lines = text.rstrip().splitlines() or [""]
    index = min(mark.line if mark else 0, len(lines) - 1)
    # libyaml has its own limit, which its scanner may hit before our check of the events
    if "nesting depth" in str(error.problem):
        problems.fail(index + 1, TOO_DEEP)
    column = f" at column {mark.column + 1}" if mark and mark.line == index else ""
    message = f"not valid YAML{column}: {error.problem}"
    if error.context:
        message += f", {error.context}"
        message += f" that begins on line {start.line + 1}" if start and start.line != index else ""
    if re.match(r" *\t", lines[index]):
        message += "; YAML is indented with spaces, not tabs"
    problems.fail(index + 1, message)


class _OpenSequence:
    """A list whose end has not been parsed yet."""

    def __init__(self, line: int, first_node: int, anchor: str | None) -> None:
        self.line, self.first_node, self.anchor = line, first_node, anchor
        self.height = 1
        self._items: list[Node] = []

    def child_line(self, line: int) -> int:
        return line

    def add(self, node: Node) -> None:
        self._items.append(node)

    def close(self) -> Node:
        return ListNode(self.line, tuple(self._items))


class _OpenMapping:
    """A mapping whose end has not been parsed yet; keys and values arrive alternately."""

    def __init__(self, line: int, first_node: int, anchor: str | None, problems: Problems) -> None:
        self.line, self.first_node, self.anchor = line, first_node, anchor
        self.height = 1
        self._problems = problems
        self._key: Node | None = None
        self._entries: dict[str, Node] = {}
        self._key_lines: dict[str, int] = {}

    def child_line(self, line: int) -> int:
        """Return the line of a node; a list or mapping after a key has the line of the key."""
        return self._key.line if self._key else line

    def add(self, node: Node) -> None:
        if self._key is None:
            self._key = node
            return
        key, self._key = self._key, None
        problem = self._key_problem(key)
        if problem:
            self._problems.add(key.line, problem)
        elif isinstance(key, TextNode):
            self._entries[key.text] = node
            self._key_lines[key.text] = key.line

    def _key_problem(self, key: Node) -> str | None:
        if not isinstance(key, TextNode):
            return f"a key must be a word, found {key}"
        if key.plain and key.text == "<<":
            return "merge keys (<<) are not allowed; write the entries out, or alias the whole value"
        if key.text in self._key_lines:
            return f"duplicate key {key}; it is already on line {self._key_lines[key.text]}"
        return None

    def close(self) -> Node:
        return MapNode(self.line, self._entries, self._key_lines)


_Open: TypeAlias = _OpenSequence | _OpenMapping


class _Anchored(NamedTuple):
    node: Node
    size: int
    height: int


class _TreeBuilder:
    """A builder that receives events one by one and stores the document in `root`."""

    def __init__(self, problems: Problems) -> None:
        self.root: Node | None = None
        self._problems = problems
        self._open: list[_Open] = []
        self._anchors: dict[str, _Anchored] = {}
        self._nodes = 0

    def add_event(self, event: yaml.Event) -> None:
        line = event.start_mark.line + 1 if event.start_mark else 0
        match event:
            case yaml.DocumentStartEvent() if self.root is not None:
                self._problems.fail(line, "a second document begins here; a file holds exactly one")
            case yaml.ScalarEvent():
                self._refuse_tag(event, line)
                node = TextNode(line, event.value, plain=not event.style)
                self._add_value(_Anchored(node, 1, 0), line, event.anchor)
            case yaml.AliasEvent():
                self._add_value(self._resolve(str(event.anchor), line), line)
            case yaml.CollectionStartEvent():
                self._refuse_tag(event, line)
                self._open_collection(event, line)
            case yaml.CollectionEndEvent():
                self._close_collection()

    def _refuse_tag(self, event: yaml.ScalarEvent | yaml.CollectionStartEvent, line: int) -> None:
        if event.tag is not None:
            tag = event.tag.replace(_CORE_TAG, "!!", 1)
            self._problems.add(line, f"the tag {tag!r} is not allowed; write the plain value without a tag")

    def _resolve(self, name: str, line: int) -> _Anchored:
        if name in self._anchors:
            return self._anchors[name]
        if any(each.anchor == name for each in self._open):
            self._problems.add(line, f"the alias *{name} is inside the value of its own anchor &{name}")
        else:
            near = nearest(name, self._anchors)
            anchor_line = f" (line {self._anchors[near].node.line})" if near else ""
            hint = (
                f"; did you mean *{near}{anchor_line}?" if near else f"; write &{name} before a value above"
            )
            self._problems.add(line, f"the alias *{name} has no anchor{hint}")
        return _Anchored(TextNode(line, "", plain=True, noted=True), 1, 0)

    def _open_collection(self, event: yaml.CollectionStartEvent, line: int) -> None:
        line = self._open[-1].child_line(line) if self._open else line
        self._check_limits(line, nodes=1, levels=1)
        first_node = self._nodes
        self._nodes += 1
        if isinstance(event, yaml.MappingStartEvent):
            self._open.append(_OpenMapping(line, first_node, event.anchor, self._problems))
        else:
            self._open.append(_OpenSequence(line, first_node, event.anchor))

    def _close_collection(self) -> None:
        closed = self._open.pop()
        anchored = _Anchored(closed.close(), self._nodes - closed.first_node, closed.height)
        self._attach(anchored, closed.anchor)

    def _add_value(self, child: _Anchored, line: int, anchor: str | None = None) -> None:
        self._check_limits(line, child.size, child.height)
        self._nodes += child.size
        self._attach(child, anchor)

    def _attach(self, child: _Anchored, anchor: str | None) -> None:
        if anchor is not None:
            self._anchors[anchor] = child
        if self._open:
            parent = self._open[-1]
            parent.height = max(parent.height, child.height + 1)
            parent.add(child.node)
        else:
            self.root = child.node

    def _check_limits(self, line: int, nodes: int, levels: int) -> None:
        if len(self._open) + levels > MAX_LEVELS:
            self._problems.fail(line, TOO_DEEP)
        if self._nodes + nodes > MAX_NODES:
            self._problems.fail(
                line, f"more than {MAX_NODES:,} keys and values, counting what aliases stand for"
            )
