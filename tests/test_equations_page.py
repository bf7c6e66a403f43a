"""The page that leads from the paper's equations to the code: each is where the page says."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

REPOSITORY = Path(__file__).parents[1]
PAGE = (REPOSITORY / "docs" / "equations.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| \((\d+)\)(?: to \((\d+)\))? \| .+ \| `([\w/]+\.py)` \| `(\w+)` \|$", re.MULTILINE)
RANGE = re.compile(r"\((\d+)\)-\((\d+)\)")
OF_THE_RUN = {14, *range(24, 32), *range(36, 75)}
"""Equations that a run of the 3R evaluates."""


class Entry(NamedTuple):
    """A row of a table: equations, and the function that has them."""

    first: int
    last: int
    path: str
    function: str


ENTRIES = [Entry(int(first), int(last or first), *place) for first, last, *place in ROW.findall(PAGE)]


def sources(entry: Entry) -> Iterator[str]:
    """The text of each function or class of that name in the file."""
    text = (REPOSITORY / "vsacli" / entry.path).read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == entry.function:
            yield ast.get_source_segment(text, node) or ""


def numbers_in(text: str) -> set[int]:
    """The equations that a text names, ranges included."""
    ranges = (range(int(first), int(last) + 1) for first, last in RANGE.findall(text))
    return {*map(int, re.findall(r"\((\d+)\)", text)), *(number for each in ranges for number in each)}


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: f"{entry.first}-{entry.function}")
def test_an_equation_is_where_the_page_says(entry: Entry) -> None:
    found = [numbers_in(text) for text in sources(entry)]
    assert any(set(range(entry.first, entry.last + 1)) <= numbers for numbers in found), found


def test_the_page_has_every_equation_of_the_run() -> None:
    assert {number for each in ENTRIES for number in range(each.first, each.last + 1)} >= OF_THE_RUN
