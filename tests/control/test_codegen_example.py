"""The closed loop of docs/codegen.md does what the page shows, with a plant that is the tool's."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.generated_code import STRICT, compile_c, write_files
from samples.marks import needs_compiler
from samples.plants import random_state

from vsacli import load_robot
from vsacli.control.codegen.project import generate
from vsacli.dynamics.forward import state_derivative

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


@pytest.mark.slow
def test_the_plant_of_the_example_is_that_of_the_tool(folder: Path) -> None:
    robot = load_robot(ROBOT)
    write_files(generate(robot), folder)
    state = random_state(robot, 1, seed=3)
    tau = np.random.default_rng(4).uniform(-50, 50, (1, 3, 2))
    values = np.concatenate([np.ravel(part) for part in (*vars(state).values(), tau)])
    source = SOURCE.read_text().replace("int main(void)", "int shown(void);\nint shown(void)")
    numbers = ", ".join(map(repr, values[:18].tolist()))
    torques = ", ".join(f"{{{a!r}, {b!r}}}" for a, b in tau[0].tolist())
    (folder / "plant.c").write_text(
        f"{source}\nint main(void)\n{{\n    const double x[STATES] = {{{numbers}}};\n"
        f"    double tau[N][2] = {{{torques}}}, dx[STATES];\n    derivative(x, tau, dx);\n"
        '    for (int i = 0; i < STATES; i++)\n        printf("%.17g\\n", dx[i]);\n    return 0;\n}\n'
    )
    compile_c(folder, *STRICT, "plant.c", "vsa_3r.c", "-o", "plant", "-lm")
    done = subprocess.run(["./plant"], cwd=folder, capture_output=True, text=True, check=True)
    found = np.array(done.stdout.split(), dtype=float)
    expected = np.concatenate([np.ravel(part) for part in state_derivative(robot, state, tau)])
    np.testing.assert_allclose(
        found, expected, rtol=1e-9
    )  # M by differences of torques some 1e3 times its own
