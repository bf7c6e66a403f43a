"""The wheel holds the package, its type marker and the examples, and nothing else."""

from __future__ import annotations

import importlib.metadata
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest
from samples.command_line import contents

import vsacli

REPOSITORY = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.Path:
    """The wheel of this tree, built without network."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=REPOSITORY, check=True, capture_output=True)
    [path] = folder.glob("*.whl")
    return zipfile.Path(path)


def files_below(folder: Path, pattern: str) -> set[str]:
    return {str(path.relative_to(REPOSITORY)) for path in folder.rglob(pattern)}


def test_the_wheel_holds_the_package_and_the_examples(wheel: zipfile.Path) -> None:
    modules = files_below(REPOSITORY / "vsacli", "*.py") | {"vsacli/compute/engine/lanes.c"}
    pages = {
        name
        for ending in ("css", "html", "js")
        for name in files_below(REPOSITORY / "vsacli" / "results" / "pages", f"*.{ending}")
    }
    examples = {
        f"vsacli/{name}"
        for folder in ("robots", "trajectories")
        for pattern in ("*.yaml", "*.csv", "*.urdf")
        for name in files_below(REPOSITORY / folder, pattern)
    }
    assert {"vsacli/robots/vsa_3r.yaml", "vsacli/trajectories/rest_to_rest.yaml"} <= examples
    content = {name for name in wheel.root.namelist() if not re.search(r"\.dist-info/|/$", name)}
    assert {"vsacli/results/pages/page.html", "vsacli/results/pages/page.css"} <= pages
    assert content == modules | pages | examples | {"vsacli/py.typed"}


def test_the_examples_in_the_wheel_are_those_of_the_repository(wheel: zipfile.Path) -> None:
    packed = (wheel / "vsacli" / "robots" / "vsa_3r.yaml").read_text(encoding="utf-8")
    assert packed == (REPOSITORY / "robots" / "vsa_3r.yaml").read_text(encoding="utf-8")


def test_what_is_installed_lists_and_copies_its_examples(wheel: zipfile.Path, tmp_path: Path) -> None:
    wheel.root.extractall(tmp_path / "installed")
    command = [sys.executable, "-m", "vsacli", "examples"]
    options: dict[str, Any] = {
        "cwd": tmp_path,
        "env": {**os.environ, "PYTHONPATH": str(tmp_path / "installed")},
        "capture_output": True,
        "text": True,
        "check": True,
    }
    listed = subprocess.run(command, **options).stdout
    names = re.findall(r"^(\w+) \(", listed, re.MULTILINE)
    assert names == sorted(path.stem for path in (REPOSITORY / "robots").rglob("*.yaml"))
    subprocess.run([*command, "--copy", "mine"], **options)
    for folder in ("robots", "trajectories"):
        assert contents(tmp_path / "mine" / folder) == contents(REPOSITORY / folder)


def test_the_wheel_says_its_licence_and_its_authors(wheel: zipfile.Path) -> None:
    [metadata] = [folder for folder in wheel.iterdir() if folder.name.endswith(".dist-info")]
    text = (metadata / "METADATA").read_text(encoding="utf-8")
    assert "License-Expression: BSD-3-Clause\n" in text
    assert "Author: the vsacli contributors\n" in text
    licence = (REPOSITORY / "docs" / "LICENSE").read_text(encoding="utf-8")
    assert (metadata / "licenses" / "docs" / "LICENSE").read_text(encoding="utf-8") == licence


def test_the_citation_is_of_this_version() -> None:
    citation = (REPOSITORY / "docs" / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {vsacli.__version__}\n" in citation


def test_the_readme_is_the_description(wheel: zipfile.Path) -> None:
    [metadata] = [name for name in wheel.root.namelist() if name.endswith(".dist-info/METADATA")]
    text = wheel.root.read(metadata).decode("utf-8")
    assert (REPOSITORY / "README.md").read_text(encoding="utf-8") in text


def test_installing_gives_the_command() -> None:
    [command] = importlib.metadata.entry_points(group="console_scripts", name="vsacli")
    assert command.value == "vsacli.__main__:main"
