"""What is released: a wheel, the source that makes the same wheel, and a recipe that says the same."""

from __future__ import annotations

import importlib.metadata
import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest
import yaml
from samples.command_line import contents

import vsacli

REPOSITORY = Path(__file__).parents[1]


def built(target: str, tree: Path, folder: Path) -> Path:
    """A wheel or a source distribution of a tree, built without network."""
    build = [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", str(folder)]
    subprocess.run(build, cwd=tree, check=True, capture_output=True)
    [path] = folder.iterdir()
    return path


@pytest.fixture(scope="module")
def wheel_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("wheel", REPOSITORY, tmp_path_factory.mktemp("wheel"))


@pytest.fixture
def wheel(wheel_file: Path) -> zipfile.Path:
    """The wheel of this tree."""
    return zipfile.Path(wheel_file)


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source distribution of this tree, unpacked."""
    path = built("sdist", REPOSITORY, tmp_path_factory.mktemp("sdist"))
    folder = tmp_path_factory.mktemp("unpacked")
    with tarfile.open(path) as archive:
        archive.extractall(folder, filter="data")
    [tree] = folder.iterdir()
    return tree


def files_below(folder: Path, pattern: str) -> set[str]:
    return {str(path.relative_to(REPOSITORY)) for path in folder.rglob(pattern)}


@pytest.mark.slow
def test_the_wheel_holds_the_package_and_the_examples(wheel: zipfile.Path) -> None:
    package = REPOSITORY / "vsacli"
    modules = files_below(package, "*.py") | files_below(package, "*.c") | files_below(package, "*.in")
    pages = {
        name
        for ending in ("css", "html", "js")
        for name in files_below(package / "results" / "pages", f"*.{ending}")
    }
    examples = {
        f"vsacli/{name}"
        for folder in ("robots", "trajectories")
        for pattern in ("*.yaml", "*.csv", "*.urdf")
        for name in files_below(REPOSITORY / folder, pattern)
    }
    assert {"vsacli/robots/vsa_3r.yaml", "vsacli/trajectories/rest_to_rest.yaml"} <= examples
    content = {name for name in wheel.root.namelist() if not re.search(r"\.dist-info/|/$", name)}
    assert "vsacli/control/codegen/templates/robot.h.in" in modules
    assert {"vsacli/results/pages/page.html", "vsacli/results/pages/page.css"} <= pages
    assert content == modules | pages | examples | {"vsacli/py.typed"}


def test_the_examples_in_the_wheel_are_those_of_the_repository(wheel: zipfile.Path) -> None:
    packed = (wheel / "vsacli" / "robots" / "vsa_3r.yaml").read_text(encoding="utf-8")
    assert packed == (REPOSITORY / "robots" / "vsa_3r.yaml").read_text(encoding="utf-8")


@pytest.mark.slow
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


def test_the_wheel_says_its_license_and_its_authors(wheel: zipfile.Path) -> None:
    [metadata] = [folder for folder in wheel.iterdir() if folder.name.endswith(".dist-info")]
    text = (metadata / "METADATA").read_text(encoding="utf-8")
    assert "License-Expression: BSD-3-Clause\n" in text
    assert "Author: the vsacli contributors\n" in text
    terms = (REPOSITORY / "docs" / "LICENSE").read_text(encoding="utf-8")
    assert (metadata / "licenses" / "docs" / "LICENSE").read_text(encoding="utf-8") == terms


def test_the_citation_is_of_this_version() -> None:
    citation = (REPOSITORY / "docs" / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {vsacli.__version__}\n" in citation


def test_the_readme_is_the_description(wheel: zipfile.Path) -> None:
    [metadata] = [name for name in wheel.root.namelist() if name.endswith(".dist-info/METADATA")]
    text = wheel.root.read(metadata).decode("utf-8")
    assert (REPOSITORY / "README.md").read_text(encoding="utf-8") in text


@pytest.mark.slow
def test_the_source_holds_what_a_clone_does_and_nothing_that_was_made(source: Path) -> None:
    found = {path.relative_to(source).parts[0] for path in source.iterdir()}
    folders = {"docs", "robots", "tests", "trajectories", "vsacli"}
    assert found == folders | {".gitignore", "PKG-INFO", "README.md", "pyproject.toml"}
    for folder in folders:
        there = contents(REPOSITORY / folder).items()
        assert contents(source / folder) == {name: text for name, text in there if "__pycache__" not in name}


@pytest.mark.slow
def test_the_source_makes_the_same_wheel(source: Path, wheel_file: Path, tmp_path: Path) -> None:
    assert built("wheel", source, tmp_path).read_bytes() == wheel_file.read_bytes()


def test_the_conda_recipe_says_what_the_project_says() -> None:
    recipe = yaml.safe_load((REPOSITORY / "docs" / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
    configuration = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    project = configuration["project"]
    context = recipe["context"]
    assert context == {"version": vsacli.__version__, "python_min": project["requires-python"].strip(">=")}
    required = {f"python >={context['python_min']}", *map(conda_name, project["dependencies"])}
    assert {
        each.replace("${{ python_min }}", context["python_min"]) for each in recipe["requirements"]["run"]
    } == required
    assert {*map(conda_name, configuration["build-system"]["requires"])} <= {*recipe["requirements"]["host"]}
    assert recipe["build"]["python"]["entry_points"] == [
        f"{name} = {target}" for name, target in project["scripts"].items()
    ]
    assert recipe["about"]["summary"] == project["description"]
    assert recipe["about"]["license"] == project["license"]


def conda_name(requirement: str) -> str:
    """A requirement as conda writes it, whose `matplotlib` brings Qt."""
    return requirement.replace(">=", " >=").replace("matplotlib ", "matplotlib-base ")


def test_installing_gives_the_command() -> None:
    [command] = importlib.metadata.entry_points(group="console_scripts", name="vsacli")
    assert command.value == "vsacli.__main__:main"
