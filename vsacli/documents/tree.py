"""The tree of a document: texts, lists and mappings, each with its line; what their meaning depends on."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping as AbstractMapping
from typing import Any, Final, NamedTuple, TypeAlias

from vsacli.base.units import Quantity
from vsacli.documents.source import Problems

MAX_SHOWN = 40


def quoted(text: str) -> str:
    """A text from a document in quotes, for messages; cut short if it is long."""
    return repr(text) if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]!r}..."


class Scalar(NamedTuple):
    """A text as written; `plain` means without quotes."""

    line: int
    text: str
    plain: bool

    def __str__(self) -> str:
        return "nothing" if self.is_null else quoted(self.text)

    @property
    def is_null(self) -> bool:
        """Whether the value is absent: nothing, `~` or `null` without quotes."""
        return self.plain and self.text.lower() in ("", "~", "null")


class Sequence(NamedTuple):
    """A list."""

    line: int
    items: tuple[Node, ...]

    def __str__(self) -> str:
        return f"a list of {len(self.items)}"


class Mapping(NamedTuple):
    """Keys, each with its line, and their values, in the order of the file."""

    line: int
    entries: AbstractMapping[str, Node]
    key_lines: AbstractMapping[str, int]

    def __str__(self) -> str:
        return "a mapping"


Node: TypeAlias = Scalar | Sequence | Mapping
"""Each prints as what was found, for "expected ..., found ...". Nodes behind aliases are shared."""


def plain(node: Node) -> Any:
    """A node as plain data: texts as written, but null, true and false without quotes as these."""
    match node:
        case Mapping(entries=entries):
            return {key: plain(entry) for key, entry in entries.items()}
        case Sequence(items=items):
            return [plain(item) for item in items]
        case Scalar(text="true" | "false" as word, plain=True):
            return word == "true"
    return None if node.is_null else node.text


INVALID: Final = object()
"""In place of a value that cannot be used; its problem is noted already."""


class Scope(NamedTuple):
    """What the meaning of a value depends on besides its own text.

    Attributes:
        problems: receives everything that is wrong.
        members: name and unit variant of every joint, for PerJoint values.
        exempt: for a purpose of PerJoint values the joints that have none, each with the reason.
        variant: the choice on which units depend here, None while it is unknown.
        survey: collects the quantity and the node of each PerJoint value, which is then not read; None to
            read them.
    """

    problems: Problems
    members: AbstractMapping[str, str]
    exempt: AbstractMapping[str, AbstractMapping[str, str]]
    variant: str | None = None
    survey: list[tuple[Quantity, Node]] | None = None

    def unit(self, quantity: Quantity) -> str:
        """Unit of a quantity here; an unknown variant is a problem of its own and must not make others."""
        return quantity.unit(self.variant or "revolute")

    def of_member(self, name: str) -> Scope:
        """The scope of the value of one joint; the same if none is called so."""
        return self._replace(variant=self.members.get(name, self.variant))

    def unexpected(self, node: Node, expected: str, label: str, reason: str = "") -> Any:
        """Note that something else was found, and return INVALID."""
        self.problems.add(node.line, f"{label}: expected {expected}, found {node}{reason}")
        return INVALID


def all_valid(values: Iterable[Any]) -> Any:
    """The values as a tuple, or INVALID if one is; each is read, so each problem is noted."""
    everything = tuple(values)
    return INVALID if INVALID in everything else everything
