"""The tree of a document: texts, lists and mappings, each with the line it stands on."""

from __future__ import annotations

from collections.abc import Mapping as AbstractMapping
from typing import NamedTuple, TypeAlias

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
