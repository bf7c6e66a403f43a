"""The messages that docs/troubleshooting.md explains are messages of the code."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from samples.sources import SOURCES, contents

PAGE = Path(__file__).parents[1] / "docs" / "troubleshooting.md"
QUOTED = re.compile(r"^\| `([^`]+)` \|", re.MULTILINE)
MESSAGES = QUOTED.findall(PAGE.read_text(encoding="utf-8"))


@cache
def texts() -> str:
    """Every text of the package; within one that is put together, `{}` stands for what differs."""
    found = [contents(source) for source in SOURCES]
    literals = (text for each in found for text, _ in each.literals)
    return "\n".join((*literals, *(text for each in found for text in (*each.formatted, *each.docstrings))))


def test_the_page_has_messages_of_every_kind() -> None:
    assert len(MESSAGES) >= 30


@pytest.mark.parametrize("message", MESSAGES)
def test_a_message_is_one_of_the_code(message: str) -> None:
    for part in message.split("…"):
        assert part.strip() in texts(), part
