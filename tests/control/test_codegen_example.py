"""The closed loop of docs/codegen.md does what the page shows."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sysconfig
from pathlib import Path

import pytest
from samples.command_line import REPOSITORY
from samples.generated_code import STRICT, compile_c, write_files
from samples.marks import needs_compiler

from vsacli import load_robot
from vsacli.control.codegen.project import generate

pytestmark = needs_compiler

PAGE = REPOSITORY / "docs" / "codegen.md"
SOURCE = REPOSITORY / "docs" / "examples" / "closed_loop.c"
ROBOT = REPOSITORY / "robots" / "vsa_3r.yaml"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with what the commands of the page need of the repository."""
    for name in ("robots", "docs/examples"):
        shutil.copytree(REPOSITORY / name, tmp_path / name)
    return tmp_path


@pytest.mark.slow
def test_the_commands_of_the_page_print_what_it_shows(folder: Path) -> None:
    (block,) = re.findall(r"^```console\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    lines = [line.removeprefix("$ ") for line in block.splitlines() if line.startswith("$ ")]
    shown = "".join(f"{line}\n" for line in block.splitlines() if not line.startswith("$ "))
    path = os.pathsep.join([sysconfig.get_path("scripts"), os.environ["PATH"]])
    done = subprocess.run(
        ["sh", "-e", "-c", "\n".join(lines)],
        cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == shown


@pytest.mark.slow
def test_the_controller_follows_the_reference_and_would_not_alone(folder: Path) -> None:
    """From 0.02 rad to the rounding of what is printed; with gains of zero the error stays."""
    assert final_error(folder, SOURCE.read_text()) == 0
    without = SOURCE.read_text().replace("four_poles_at(-20)", "four_poles_at(0)")
    assert without != SOURCE.read_text()
    assert final_error(folder, without) > 0.005


def final_error(folder: Path, source: str) -> float:
    """rad, at the end."""
    write_files(generate(load_robot(ROBOT)), folder)
    (folder / "loop.c").write_text(source)
    compile_c(folder, *STRICT, "-O1", "loop.c", "vsa_3r.c", "-o", "loop", "-lm")
    done = subprocess.run(["./loop"], cwd=folder, capture_output=True, text=True, check=True)
    found = re.search(r"t = 2\.50 s: largest error (\S+) rad", done.stdout)
    assert found
    return float(found[1])
