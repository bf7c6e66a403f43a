"""Remarks on numbers of a YAML file, as comments at the ends of their lines."""

from __future__ import annotations

import re
from collections.abc import Mapping

import yaml

from vsacli.documents.edited import node_at

_EARLIER = re.compile(r"(?:\s*#|;) \w+ \+- [^\s,;]+(?:, \w+ \+- [^\s,;]+)*$")
"""What an earlier call put there."""


def with_errors(text: str, errors: Mapping[str, str]) -> str:
    """The text with standard errors behind the numbers at some paths, e.g. `k +- 0.4`, behind other comments.

    Args:
        text: a YAML document that can be read.
        errors: by path, entries of lists by index; those of numbers that do not stand there do not count.
    """
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    assert root is not None, "a document that can be read"
    by_line: dict[int, list[str]] = {}
    for path, error in errors.items():
        *_, key = path.split(".")
        node = node_at(root, path)
        if node is not None:
            by_line.setdefault(node.start_mark.line, []).append(f"{key} +- {error}")
    lines = text.split("\n")
    ends = _content_ends(text)
    for number, remarks in by_line.items():
        line = _EARLIER.sub("", lines[number].rstrip())
        mark_ = "; " if "#" in line[ends[number] :] else "  # "
        lines[number] = line + mark_ + ", ".join(remarks)
    return "\n".join(lines)


def _content_ends(text: str) -> dict[int, int]:
    """Column in which the last token of each line ends, behind which a comment may stand."""
    ends: dict[int, int] = {}
    for token in yaml.scan(text, Loader=yaml.SafeLoader):
        ends[token.end_mark.line] = max(ends.get(token.end_mark.line, 0), token.end_mark.column)
    return ends
