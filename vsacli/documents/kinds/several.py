"""One value, or a list of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from vsacli.documents import tree
from vsacli.documents.kinds.lists import Items
from vsacli.documents.records import Check, Refer, Schema
from vsacli.documents.tree import INVALID, Node, Scope


@dataclass(eq=False)
class OneOrMore(Items):
    """One value of a kind, or a list of one or more, read as a tuple."""

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """The values."""
        if isinstance(node, tree.Sequence):
            return super().read(node, label, scope)
        one = self.item.read(node, label, scope)
        return one if one is INVALID else (one,)

    def schema(self, check: Check | None, refer: Refer, /) -> Schema:
        """One, or a list."""
        return {"anyOf": [self.item.schema(check, refer), super().schema(check, refer)]}

    @property
    def words(self) -> str:
        """What one is."""
        return f"{self.item.words}; or a list of these"
