"""Values for JSON, which has no numbers that are not finite: there and back."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

JsonObject: TypeAlias = Mapping[str, Any]
"""An object of JSON."""


def finite(content: Any) -> Any:
    """The same JSON values, with None for numbers that are not finite."""
    if isinstance(content, dict):
        return {key: finite(entry) for key, entry in content.items()}
    if isinstance(content, list):
        return [finite(entry) for entry in content]
    if isinstance(content, float) and not math.isfinite(content):
        return None
    return content


def number(entry: float | None) -> float:
    """NaN for None."""
    return math.nan if entry is None else entry


def pair(entries: Iterable[float | None]) -> tuple[float, float]:
    """Two numbers, NaN for None."""
    first, second = map(number, entries)
    return first, second
