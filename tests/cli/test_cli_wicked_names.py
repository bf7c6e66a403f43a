"""Names that would act on what shows them: refused with their line; of no effect in C and in old results."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import h5py
import pytest
from samples.command_line import REPOSITORY, ROBOT
from samples.marks import needs_compiler
from samples.wicked import PRINTABLE, UNPRINTABLE, as_yaml, clean

TRAJECTORY = REPOSITORY / "trajectories" / "rest_to_rest.yaml"


def renamed(path: Path, folder: Path, name: str) -> Path:
    """A copy of a file whose `name` is another."""
    copy = folder / path.name
    text = path.read_text(encoding="utf-8")
    copy.write_text(re.sub(r"(?m)^name: .*$", lambda _: f"name: {as_yaml(name)}", text), encoding="utf-8")
    return copy


def bare(code: str) -> str:
    """C without comments, and without the digests of all of it and of the robot file, which has the name."""
    return re.sub(r'0x[0-9a-f]{8}u|"[0-9a-f]{64}"', "", re.sub(r"/\*.*?\*/", "", code, flags=re.S))


@pytest.mark.cases(2)
@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("name", PRINTABLE.values(), ids=PRINTABLE)
def test_generated_code_is_what_it_is_under_any_name(vsacli: Any, tmp_path: Path, name: str) -> None:
    """Without its comments every file is the one that a harmless name gives, and the compiler is content."""
    assert vsacli("codegen", renamed(ROBOT, tmp_path, name), "-o", "code").code == 0
    prefix = next((tmp_path / "code").glob("*.h")).stem
    assert vsacli("codegen", renamed(ROBOT, tmp_path, prefix), "-o", "plain").code == 0
    for path in (tmp_path / "code").glob("*.[ch]"):
        code, plain = (
            bare((tmp_path / folder / path.name).read_text(encoding="utf-8")) for folder in ("code", "plain")
        )
        assert code == plain
    command = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"{prefix}.c"]
    assert subprocess.run(command, cwd=tmp_path / "code", check=False).returncode == 0


@pytest.mark.parametrize("name", UNPRINTABLE.values(), ids=UNPRINTABLE)
@pytest.mark.parametrize("which", [ROBOT, TRAJECTORY], ids=["robot", "trajectory"])
def test_other_names_are_refused_with_their_line(vsacli: Any, tmp_path: Path, which: Path, name: str) -> None:
    files = [renamed(path, tmp_path, name if path == which else "arm") for path in (ROBOT, TRAJECTORY)]
    done = vsacli("validate", *files)
    assert done.code == 2
    line = next(n for n, text in enumerate(which.read_text().splitlines(), 1) if text.startswith("name: "))
    assert re.search(rf"{which.name}:{line}: .*(name|character|code point)", done.out + done.err)
    assert clean(done.out + done.err)


def test_a_description_may_have_lines_but_no_control_characters(vsacli: Any, tmp_path: Path) -> None:
    text = ROBOT.read_text(encoding="utf-8")
    for description, code in (("a\nb " * 200, 0), ("a\x1b[2J", 2)):
        copy = tmp_path / "arm.yaml"
        copy.write_text(
            re.sub(r"(?m)^description: .*$", lambda _, d=description: f"description: {as_yaml(d)}", text)
        )
        done = vsacli("validate", copy)
        assert done.code == code
        assert clean(done.out + done.err)


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["escape", "return", "break", "bidirectional", "c1"])
def test_older_results_with_such_names_are_shown_encoded(vsacli: Any, tmp_path: Path, name: str) -> None:
    assert vsacli("invdyn", ROBOT, TRAJECTORY, "-o", "r.h5", "-q").code == 0
    with h5py.File(tmp_path / "r.h5", "r+") as file:
        file.attrs["robot_name"] = UNPRINTABLE[name]
        file.attrs["command_line"] = UNPRINTABLE[name]
        report = json.loads(file["report/json"].asstr()[()])
        report |= {"robot": UNPRINTABLE[name], "warnings": [UNPRINTABLE[name]]}
        file["report/json"][()] = json.dumps(report)
    for arguments in (("info", "r.h5"), ("validate", "r.h5"), ("plot", "r.h5", "-v"), ("export", "r.h5")):
        done = vsacli(*arguments)
        assert done.code == 0
        assert clean(done.out + done.err)
    told = vsacli("info", "r.h5").out
    assert UNPRINTABLE[name].encode("unicode_escape").decode() in told


def test_extracted_files_have_names_in_one_line(vsacli: Any, own_folder: Path) -> None:
    """Their stored paths may have characters that move a cursor or turn the direction of writing."""
    robot, trajectory = own_folder / "two\nlines.yaml", own_folder / "esc\x1b[2Jand\u202e.yaml"
    robot.write_bytes(ROBOT.read_bytes())
    trajectory.write_bytes(TRAJECTORY.read_bytes())
    assert vsacli("invdyn", robot.name, trajectory.name, "--set", "rate=10", "-o", "r.h5").code == 0
    done = vsacli("info", "r.h5", "--extract", "inputs")
    assert done.code == 0
    names = [r"two\nlines.yaml", r"esc\x1b[2Jand\u202e.yaml"]
    assert sorted(path.name for path in Path("inputs").iterdir()) == sorted(names)
    assert done.err.splitlines()[:2] == [f"wrote inputs/{name}" for name in names]
