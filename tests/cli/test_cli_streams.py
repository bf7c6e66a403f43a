"""Standard input and output in place of files, and readers that go away."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from samples.command_line import COMMAND, REST_TO_REST, ROBOT, contents, installed


def piped(content: bytes, *arguments: object, folder: Path) -> subprocess.CompletedProcess[bytes]:
    """Run the installed command on what a pipe brings."""
    command = [str(COMMAND), *map(str, arguments)]
    return subprocess.run(command, input=content, cwd=folder, capture_output=True, check=False)


@pytest.mark.slow
def test_a_robot_from_a_pipe_is_the_robot_of_the_file(tmp_path: Path) -> None:
    from_file = installed("check-feasibility", ROBOT, REST_TO_REST, folder=tmp_path)
    done = piped(ROBOT.read_bytes(), "check-feasibility", "-", REST_TO_REST, folder=tmp_path)
    assert (done.returncode, done.stdout.decode()) == (0, from_file.stdout)


@pytest.mark.slow
def test_a_recording_from_a_pipe(tmp_path: Path, feasible_result: Path) -> None:
    table = installed("export", feasible_result, "--variables", "q,stiffness", "-o", "-", folder=tmp_path)
    done = piped(table.stdout.encode(), "invdyn", ROBOT, "-", folder=tmp_path)
    assert done.returncode in (0, 3)
    assert set(contents(tmp_path)) == {"vsa_3r-stdin.h5"}


@pytest.mark.slow
def test_what_is_wrong_with_a_pipe_is_told_with_its_line(tmp_path: Path) -> None:
    wrong = ROBOT.read_bytes().replace(b"mass: 9.0478", b"mass: -9")
    done = piped(wrong, "validate", "-", folder=tmp_path)
    line = wrong[: wrong.index(b"mass: -9")].count(b"\n") + 1
    assert done.returncode == 2
    assert done.stdout.decode().startswith(f"-:{line}: mass: must be")


@pytest.mark.slow
def test_a_closed_standard_input(tmp_path: Path) -> None:
    done = subprocess.run(
        f"{COMMAND} validate - <&-", shell=True, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout + done.stderr) == (
        2,
        "-: cannot be read: standard input is closed\n",
    )


def test_templates_go_to_standard_output(vsacli: Any, tmp_path: Path) -> None:
    assert (
        vsacli("new", "robot", "--joints", "R", "-o", "-").out == vsacli("new", "robot", "--joints", "R").out
    )
    assert contents(tmp_path) == {}


@pytest.mark.parametrize("command", ["invdyn", "simulate"])
def test_binary_files_do_not(vsacli: Any, tmp_path: Path, command: str) -> None:
    done = vsacli(command, ROBOT, REST_TO_REST, "-o", "-")
    assert (done.code, done.err) == (2, "-: standard output cannot hold this; name a file\n")
    assert contents(tmp_path) == {}


@pytest.mark.slow
def test_a_result_is_whole_although_nobody_reads_its_report(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = installed("invdyn", ROBOT, REST_TO_REST, "-o", "r.h5", folder=tmp_path, stdout=writing)
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (0, "wrote r.h5\n")
    assert set(contents(tmp_path)) == {"r.h5"}


def test_a_warning_of_numpy_does_not_reach_the_user() -> None:
    """It says nothing that a user could act on; `python -W` shows it to a developer."""
    program = (
        "import sys, numpy as np, vsacli.cli.main\n"
        "command = sys.modules['vsacli.cli.main']\n"
        "command.run = lambda _: int(np.isfinite(np.array([1e308]) * 10).any())\n"
        "command.main()"
    )
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONWARNINGS"}
    for options, silent in (((), True), (("-W", "default"), False)):
        done = subprocess.run(
            [sys.executable, *options, "-c", program],
            env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0
        assert ("RuntimeWarning: overflow" not in done.stderr) is silent
