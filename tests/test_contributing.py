"""The guide for contributors: its recipes work as they stand, and the way of a run names what exists."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
from samples.marks import slow_but

REPOSITORY = Path(__file__).parents[1]
PACKAGE = REPOSITORY / "vsacli"
GUIDE = (REPOSITORY / "docs" / "contributing.md").read_text(encoding="utf-8")
RECIPES = dict(re.findall(r"^### (.+)\n((?:(?!^##).*\n)*)", GUIDE, re.MULTILINE))
BLOCK = re.compile(
    r"^(?P<before>[^\n]+)\n\n```(?P<language>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
NEW_FILE = re.compile(r"New file `(?P<path>\S+)`:")
INSERTION = re.compile(r"In `(?P<path>\S+)`, below `(?P<anchor>.+)`:")
EXIT_CODE = re.compile(r"# exit code (\d+)$")
STATION = re.compile(r"`(?P<path>[\w/]+\.py)`\s+`(?P<name>\w+)`")


class Applied(NamedTuple):
    """A copy of the package to which a recipe was applied.

    Attributes:
        folder: holds the package, robots and trajectories.
        command: of the recipe.
        output: lines that the recipe shows of its output.
    """

    folder: Path
    command: str
    output: list[str]


def applied(recipe: str, folder: Path) -> Applied:
    """Copy the package, and make the new files and insertions of a recipe."""
    for name in ("vsacli", "robots", "trajectories"):
        shutil.copytree(REPOSITORY / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    command, output = "", list[str]()
    for block in BLOCK.finditer(RECIPES[recipe]):
        if new := NEW_FILE.fullmatch(block["before"]):
            (folder / new["path"]).write_text(block["text"], encoding="utf-8")
        elif insertion := INSERTION.fullmatch(block["before"]):
            added = re.sub(r"^\+", "", block["text"], flags=re.MULTILINE)
            insert(folder / insertion["path"], insertion["anchor"], added)
    for language, text in re.findall(r"^```(\w+)\n(.*?)^```$", RECIPES[recipe], re.MULTILINE | re.DOTALL):
        command = text.strip() if language == "bash" else command
        output += text.splitlines() if language == "text" else []
    return Applied(folder, command, output)


def insert(path: Path, anchor: str, text: str) -> None:
    """Insert a text below the only line that is the anchor, but for its indent."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    (place,) = (number for number, line in enumerate(lines) if line.strip() == anchor)
    path.write_text("".join([*lines[: place + 1], text, *lines[place + 1 :]]), encoding="utf-8")


@pytest.mark.cases(5)
@pytest.mark.parametrize("recipe", slow_but({"A limit with a flag"}, RECIPES))
def test_a_recipe_works_as_it_stands(recipe: str, tmp_path: Path) -> None:
    folder, command, output = applied(recipe, tmp_path)
    line = command.replace("vsacli ", f"{sys.executable} -m vsacli ").replace(
        "python -c", f"{sys.executable} -c"
    )
    run = subprocess.run(
        ["sh", "-c", line],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    expected = EXIT_CODE.search(command)
    assert run.returncode == int(expected[1] if expected else 0), run.stderr
    assert [shown for shown in output if shown not in run.stdout.splitlines()] == []


def test_a_recipe_fails_without_what_it_adds(tmp_path: Path) -> None:
    folder, command, _ = applied("A command", tmp_path)
    (folder / "vsacli" / "cli" / "peak.py").unlink()
    line = command.replace("vsacli ", f"{sys.executable} -m vsacli ")
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    run = subprocess.run(["sh", "-c", line], cwd=folder, env=environment, capture_output=True, check=False)
    assert run.returncode != 0


def test_there_is_a_recipe_for_each_typical_change_of_at_most_ten_lines_of_text() -> None:
    assert len(RECIPES) == 8
    for recipe in RECIPES.values():
        prose = re.sub(r"^```\w+\n.*?^```$", "", recipe, flags=re.MULTILINE | re.DOTALL)
        assert len([line for line in prose.splitlines() if line]) <= 10


def test_the_way_of_a_run_names_what_exists() -> None:
    stations = STATION.findall(GUIDE.partition("## One run")[2].partition("\n## ")[0])
    assert len(stations) > 10
    for path, name in stations:
        tree = ast.parse((PACKAGE / path).read_text(encoding="utf-8"))
        assert name in {getattr(node, "name", "") for node in ast.walk(tree)}, f"{path}: {name}"
