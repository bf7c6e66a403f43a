"""Descriptions as text."""

from __future__ import annotations

from collections.abc import Mapping
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
