"""The messages that docs/troubleshooting.md explains are messages of the code."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import vsacli

PAGE = Path(__file__).parents[1] / "docs" / "troubleshooting.md"
QUOTED = re.compile(r"^\| `([^`]+)` \|", re.MULTILINE)
MESSAGES = QUOTED.findall(PAGE.read_text(encoding="utf-8"))


@cache
def texts() -> str:
    """Every text of the package; within one that is put together, `{}` stands for what differs."""
    sources = Path(vsacli.__file__).parent.rglob("*.py")
    return "\n".join(text for source in sources for text in texts_of(source))


def texts_of(source: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        match node:
            case ast.JoinedStr(values=parts):
                yield "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in parts)
            case ast.Constant(value=str(text)):
                yield text


def test_the_page_has_messages_of_every_kind() -> None:
    assert len(MESSAGES) >= 30


@pytest.mark.parametrize("message", MESSAGES)
def test_a_message_is_one_of_the_code(message: str) -> None:
    for part in message.split("…"):
        assert part.strip() in texts(), part
