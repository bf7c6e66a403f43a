"""A share of one, in per cent or as a number."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from vsacli.base.units import DIMENSIONLESS
from vsacli.documents.kinds.single import EXPRESSION, Number, read_number
from vsacli.documents.records import Check, Refer, Schema
from vsacli.documents.tree import INVALID, Node, Scalar, Scope

PER_CENT = re.compile(r"(?P<number>.*\S)\s*%")
"""How a share in per cent is written."""


@dataclass(eq=False)
class Share(Number):
    """A share such as `3 %` or `0.03`."""

    unit = DIMENSIONLESS
    words = "share, such as `3 %` or `0.03`"

    def __init__(self) -> None:
        """The unit is none."""

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """The share as a number."""
        share = PER_CENT.fullmatch(node.text) if isinstance(node, Scalar) else None
        if share is None:
            return super().read(node, label, scope)
        number = read_number(Scalar(node.line, share["number"], plain=True), str(DIMENSIONLESS), label, scope)
        return number if number is INVALID else number / 100

    def schema(self, check: Check | None, refer: Refer, /) -> Schema:
        """A number, an expression, or one of these in per cent."""
        plain = super().schema(check, refer)
        return {"anyOf": [*plain["anyOf"], {"type": "string", "pattern": EXPRESSION[:-1] + "%$"}]}
