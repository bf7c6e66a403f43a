"""Descriptions as text, with their numbers and ranges."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from vsacli.base.lazy import LazyRegistry

_LINES = LazyRegistry(
    {
        "robot": "vsacli.files.info.robot_lines:robot_lines",
        "trajectory": "vsacli.files.info.trajectory_info:trajectory_lines",
        "recording": "vsacli.files.recordings:recording_lines",
        "result": "vsacli.files.info.result_info:result_lines",
        "simulation": "vsacli.files.info.result_info:result_lines",
        "table of a study": "vsacli.files.info.study_info:study_lines",
        "cache": "vsacli.files.info.cache_info:cache_lines",
    }
)
"""Functions that yield the lines of a description, by its kind."""


def render(description: Mapping[str, Any]) -> str:
    """Return a description as lines of text, without a final newline."""
    return "\n".join(_LINES[description["kind"]](description))


SHOWN_DIGITS = 5


def row(values: Iterable[float]) -> str:
    """Return numbers with spaces between them."""
    return " ".join(map(short, values))


def short(value: float) -> str:
    """Return a number with few digits; a dash for NaN."""
    return "-" if math.isnan(value) else f"{value:.{SHOWN_DIGITS}g}"


def range_text(ends: Mapping[str, float]) -> str:
    """Return a range of values by its ends `min` and `max`; one number if they are equal."""
    low, high = ends["min"], ends["max"]
    return short(low) if math.isnan(low) or low == high else f"{short(low)} to {short(high)}"


def span(ends: Sequence[float], unit: str) -> str:
    """Return an interval with its unit; a dash without bounds, `none` if it is empty."""
    low, high = ends
    if math.isnan(low) or low > high:
        return "none"
    if math.isinf(low) and math.isinf(high):
        return "-"
    if low == high:
        return f"{short(low)} {unit}"
    if math.isinf(high):
        return f"from {short(low)} {unit}"
    return f"to {short(high)} {unit}" if math.isinf(low) else f"{short(low)} to {short(high)} {unit}"
