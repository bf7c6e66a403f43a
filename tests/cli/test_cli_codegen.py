"""`vsacli codegen`: what it writes, what it refuses, and what it leaves alone."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from samples.command_line import REPOSITORY, ROBOT, Outcome, contents, edited
from samples.generated_code import STRICT, compile_c
from samples.marks import needs_compiler

from vsacli import Robot
from vsacli.cli.console import Exit
from vsacli.control.codegen.project import prefix_of

Run = Callable[..., Outcome]

FILES = {
    *("vsa_3r.c", "vsa_3r.h", "vsa_3r_test.c", "vsa_3r.py", "vsa_3r_gpu.cu", "vsa_3r_gpu.py"),
    *("Makefile", "CMakeLists.txt", "README.md"),
}


def test_it_writes_the_files_and_says_so(vsacli: Run, tmp_path: Path) -> None:
    outcome = vsacli("codegen", ROBOT, "-o", "controller/arm")
    assert outcome.code == Exit.OK
    folder = tmp_path / "controller" / "arm"
    assert set(contents(folder)) == FILES
    assert outcome.out == ""
    assert {line.removeprefix("wrote controller/arm/") for line in outcome.err.splitlines()} == FILES
    assert "double q[3];" in (folder / "vsa_3r.h").read_text()


def test_quiet_and_single_precision(vsacli: Run, tmp_path: Path) -> None:
    outcome = vsacli("codegen", ROBOT, "-o", "arm", "--precision", "float", "-q")
    assert (outcome.code, outcome.out, outcome.err) == (Exit.OK, "", "")
    assert "float q[3];" in (tmp_path / "arm" / "vsa_3r.h").read_text()
    assert "double" not in (tmp_path / "arm" / "vsa_3r.c").read_text().replace("double.", "")


@needs_compiler
def test_the_written_files_compile(vsacli: Run, tmp_path: Path) -> None:
    vsacli("codegen", REPOSITORY / "robots" / "tendon_1r.yaml", "-o", "arm", "-q")
    compile_c(tmp_path / "arm", *STRICT, "tendon_1r.c", "tendon_1r_test.c", "-o", "test", "-lm")


@pytest.mark.slow
def test_existing_files_stay_unless_told_otherwise(vsacli: Run, tmp_path: Path) -> None:
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm" / "README.md").write_text("mine")
    (tmp_path / "arm" / "main.c").write_text("mine too")
    before = contents(tmp_path)
    outcome = vsacli("codegen", ROBOT, "-o", "arm")
    assert outcome.code == Exit.STORAGE
    assert "arm/README.md: " in outcome.err
    assert "--overwrite" in outcome.err
    assert contents(tmp_path) == before

    assert vsacli("codegen", ROBOT, "-o", "arm", "--overwrite").code == Exit.OK
    after = contents(tmp_path / "arm")
    assert after.pop("main.c") == b"mine too"
    assert set(after) == FILES
    assert after["README.md"] != b"mine"


def test_a_file_in_place_of_the_folder(vsacli: Run, tmp_path: Path) -> None:
    (tmp_path / "arm").write_text("mine")
    outcome = vsacli("codegen", ROBOT, "-o", "arm", "--overwrite")
    assert outcome.code == Exit.STORAGE
    assert "arm: is a file; name a folder" in outcome.err
    assert (tmp_path / "arm").read_text() == "mine"


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_folder_without_permission(vsacli: Run, tmp_path: Path) -> None:
    (tmp_path / "locked").mkdir(mode=0o500)
    outcome = vsacli("codegen", ROBOT, "-o", "locked")
    assert outcome.code == Exit.STORAGE
    assert "no permission" in outcome.err
    assert contents(tmp_path) == {}


def test_a_folder_that_cannot_be_made(vsacli: Run, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    outcome = vsacli("codegen", ROBOT, "-o", "file/arm")
    assert outcome.code == Exit.STORAGE
    assert "file/arm: file is a file; name a folder" in outcome.err
    assert contents(tmp_path) == {"file": b"mine"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((ROBOT,), "Missing option '-o' / '--output'"),
        ((ROBOT, "-o", "arm", "--precision", "half"), "'half' is not one of 'double', 'float'"),
        (("nowhere.yaml", "-o", "arm"), "nowhere.yaml"),
    ],
)
def test_usage(arguments: tuple[object, ...], message: str, vsacli: Run, tmp_path: Path) -> None:
    outcome = vsacli("codegen", *arguments)
    assert outcome.code == Exit.USAGE
    assert message in outcome.err
    assert contents(tmp_path) == {}


def test_a_wrong_robot_writes_nothing(vsacli: Run, tmp_path: Path) -> None:
    wrong = edited(ROBOT, tmp_path / "wrong.yaml", ("mass: 9.0478", "mass: -9"))
    outcome = vsacli("codegen", wrong, "-o", "arm")
    assert outcome.code == Exit.USAGE
    assert "wrong.yaml:" in outcome.err
    assert not (tmp_path / "arm").exists()


def test_what_is_left_out_is_said(vsacli: Run) -> None:
    outcome = vsacli("codegen", REPOSITORY / "robots" / "mixed_3r.yaml", "-o", "arm")
    assert outcome.code == Exit.OK
    assert "no feedback_linearization" in outcome.err


@pytest.mark.parametrize(
    ("name", "prefix"),
    [("vsa-3r", "vsa_3r"), ("7R arm", "robot_7r_arm"), ("Größe µ", "gr_e"), ("--", "robot"), ("INT", "int")],
)
def test_names_in_c(name: str, prefix: str) -> None:
    assert prefix_of(Robot(name=name, joints=())) == prefix
