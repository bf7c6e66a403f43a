"""The examples of the pages: shell lines, what they print, and files to save.

Tests run them; `generate.py` renews what they print.
"""

from __future__ import annotations

import difflib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator
from itertools import pairwise, takewhile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
SCRIPTS = Path(sysconfig.get_path("scripts"))

FENCED = re.compile(r"(?:^([^\n]*)\n\n?)?^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SAVED_AS = re.compile(r"Save as `(\S+)`:$")
SETTING_UP = re.compile(r"-m venv|pip install")
HELP_EXAMPLE = re.compile(r"^ +(vsacli .*)$", re.MULTILINE)
PRINTED = re.compile(r"^ *print\(.*?\)(?:  # ([^:\n]*)[^\n]*)?$", re.MULTILINE)
"""Statements that print, and what they print if a comment says so."""

ROUNDING = re.compile(r"self-check passed \(\S+,")
"""The part of a report that differs between machines."""


class Block(NamedTuple):
    """A fenced block of a page, the line of text before it, and the place of its text in the page."""

    before: str
    language: str
    text: str
    span: tuple[int, int]

    @property
    def saved_as(self) -> str | None:
        """Name of the file that this block is to be saved as, if it is one."""
        match = SAVED_AS.search(self.before)
        return match[1] if match else None


def blocks(page: Path) -> list[Block]:
    """Return the fenced blocks of a page, in order."""
    found = FENCED.finditer(page.read_text(encoding="utf-8"))
    return [Block(match[1] or "", match[2], match[3], match.span(3)) for match in found]


def commands(block: Block) -> Iterator[str]:
    """Yield the shell lines of a block that run vsacli, without those that make an environment."""
    if block.language == "text":
        yield from HELP_EXAMPLE.findall(block.text.partition("Example:")[2])
    elif block.language == "sh" and re.search(r"\bvsacli ", block.text):
        for line in block.text.splitlines():
            parts = [part for part in line.split(" && ") if not SETTING_UP.search(part)]
            yield from [" && ".join(parts).replace(".venv/bin/", "")] if parts else []


def run_shell(line: str, folder: Path, scripts: Path = SCRIPTS) -> subprocess.CompletedProcess[str]:
    """Run a shell line in a folder, with the command in `scripts` on the search path."""
    path = os.pathsep.join([str(scripts), os.environ["PATH"]])
    return subprocess.run(
        ["sh", "-c", line],
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


def comparable(report: str) -> str:
    """Return a report without what differs between machines."""
    return ROUNDING.sub("self-check passed (,", report).strip()


def copy_examples(folder: Path) -> None:
    """Copy the bundled robots and trajectories into a folder, as a clone has them."""
    for name in ("robots", "trajectories"):
        shutil.copytree(ROOT / name, folder / name)


def make_files_of_other_pages(folder: Path, scripts: Path = SCRIPTS) -> None:
    """Make the files that help texts mention: studies, motors, and the recording that is identified."""
    for name in ("identification.md", "sizing.md", "studies.md"):
        for block in blocks(ROOT / "docs" / name):
            if block.saved_as:
                (folder / block.saved_as).write_text(block.text)
    making = [line for block in blocks(ROOT / "docs" / "identification.md") for line in commands(block)]
    for line in takewhile(lambda line: not line.startswith("vsacli identify"), making):
        assert run_shell(line, folder, scripts).returncode == 0


def renewed(page: Path) -> str:
    """Return the text of a page whose examples show what they print now; commented values stay."""
    text = page.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as name:
        copy_examples(Path(name))
        for (start, end), shown in sorted(_outputs(page, Path(name)).items(), reverse=True):
            text = text[:start] + shown + text[end:]
    return text


def _outputs(page: Path, folder: Path) -> dict[tuple[int, int], str]:
    """Return what stale blocks of a page should show, by place."""
    found: dict[tuple[int, int], str] = {}
    printed: list[str] = []
    for block in blocks(page):
        if block.saved_as:
            (folder / block.saved_as).write_text(block.text)
        if block.language == "text" and printed and comparable(block.text) not in map(comparable, printed):
            found[block.span] = max(printed, key=lambda each: _likeness(each, block.text)).strip() + "\n"
        printed = []
        for line in commands(block):
            outcome = run_shell(line, folder)
            if block.language == "sh":
                printed = [outcome.stdout, outcome.stderr]
    return found | _printed_by_python(page, folder)


def _likeness(one: str, other: str) -> float:
    return difflib.SequenceMatcher(None, one, other).ratio()


def _printed_by_python(page: Path, folder: Path) -> dict[tuple[int, int], str]:
    """Return what stale blocks behind Python blocks should show: the output of the last print before them."""
    everything = blocks(page)
    code, mark = "", "\x1e"
    for block in everything:
        if block.language == "python":
            code += block.text + f"\nprint({mark!r}, end='')\n"
    if not code:
        return {}
    outcome = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )
    outputs = iter(outcome.stdout.split(mark))
    found = {}
    for block, behind in pairwise(everything):
        if block.language != "python":
            continue
        output = next(outputs, "")
        commented = [comment for comment in PRINTED.findall(block.text) if comment]
        lines = output.splitlines(keepends=True)
        shown = "".join(lines[len(commented) :]) if commented else output
        if behind.language == "text" and shown and comparable(behind.text) not in comparable(output):
            found[behind.span] = shown.strip() + "\n"
    return found
