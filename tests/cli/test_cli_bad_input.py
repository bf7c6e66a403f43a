"""Input that cannot be used: exit code 2, one line for each problem, nothing written, no traceback."""

from __future__ import annotations

import os
import re

import pytest
from samples.command_line import REST_TO_REST, ROBOT, contents, edited, installed

HEADER = "time,q1,q2,q3,stiffness1,stiffness2,stiffness3\n"
ROWS = [f"0.{row},0,0,0,900,900,900\n" for row in range(9)]

ALIAS_BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join(['*' + before] * 9)}]\n"
    for before, name in zip("abcdefg", "bcdefgh", strict=True)
)

# Each case: what is put in place of what, and the lines the user gets, as "line number: part of the message".
ROBOT_EDITS = {
    "missing key": (("mass: 9.0478 ", "# "), ["12: missing key 'mass'"]),
    "unknown key": (("gravity:", "gravty:"), ["7: unknown key 'gravty'; did you mean 'gravity'?"]),
    "duplicate key": (("name: vsa-3r", "name: a\nname: b"), ["6: duplicate key 'name'"]),
    "boolean": (("mass: 9.0478", "mass: on"), ["13: mass: expected a number in kg, found 'on'"]),
    "vector length": (("com: [0, 0, 0]", "com: [0, 0]"), ["14: com: expected 3 numbers in m, found 2"]),
    "negative eigenvalue": (("xx: 0.1299", "xx: -0.1299"), ["15: negative eigenvalue -0.1299 kg m^2"]),
    "Python tag": (("name: vsa-3r", "name: !!python/name:os.system vsa"), ["5: !!python/name:os.system"]),
    "NaN": (("mass: 9.0478", "mass: .nan"), ["13: only finite numbers"]),
    "word": (("mass: 9.0478", "mass: heavy"), ["13: mass: expected a number in kg, found 'heavy'"]),
    "other format": (("robot/1", "robot/2"), ["4: format: expected 'vsacli-robot/1'"]),
    "undefined alias": (
        ("&spring {type", "&sprng {type"),
        [
            "33: the alias *spring has no anchor; did you mean *sprng (line 20)?",
            "46: the alias *spring has no anchor; did you mean *sprng (line 20)?",
        ],
    ),
    "two problems": (
        ("damping: 1e-5                 # N m s/rad, b", "damping: -1e-5\n    dampping: 0"),
        ["16: damping: must be", "17: unknown key 'dampping'; did you mean 'damping'?"],
    ),
}

TRAJECTORY_EDITS = {
    "degree 5 position": (
        ("degree: 7", "degree: 5"),
        ["9: derivatives up to the third must vanish at both ends"],
    ),
    "degree 1 stiffness": (("degree: 3", "degree: 1"), ["14: its rate must vanish at both ends"]),
    "list length": (
        ("[90 deg, 45 deg, -60 deg]", "[1, 2]"),
        ["11: end: expected 3 values, one for each joint (base, shoulder, elbow), found 2"],
    ),
    "infinity": (("duration: 4.0", "duration: .inf"), ["5: only finite numbers"]),
    "negative stiffness": (
        ("start: 850", "start: [1, -1, 1]"),
        ["15: joint shoulder: must be positive, not -1 N m/rad"],
    ),
    "negative stiffness of two": (
        ("start: 850", "start: [-1, 1, -1]"),
        ["15: start of joints base, elbow: must be positive, not -1 N m/rad"],
    ),
    "negative stiffness of all": (
        ("start: 850", "start: -850"),
        ["15: start: must be positive, not -850 N m/rad"],
    ),
}

ROBOT_FILES = {
    "empty file": (b"", [": is empty; expected a YAML file that begins with `format: vsacli-robot/1`"]),
    "alias bomb": (ALIAS_BOMB.encode(), ["6: more than 100,000 keys and values"]),
    "nested brackets": (b"[" * 3000 + b"]" * 3000, ["1: nested more than 20 levels deep"]),
    "binary": (b"\0\1\2", [": is a binary file, but ROBOT must be a robot file (YAML)"]),
    "not UTF-8": (b"name: \xff\xfe", ["1: UTF-8"]),
    "text": (b"hello", ["1: expected a YAML file that begins with `format: vsacli-robot/1`"]),
}

TABLES = {
    "time goes back": ((ROWS[4], ROWS[2]), ["6: time must increase, but 0.2 s follows 0.3 s"]),
    "ragged row": (
        (ROWS[4], "0.4,0,0\n"),
        ["6: expected 7 values, one for each column of the header, found 3"],
    ),
    "NaN": (("0.4,0", "0.4,nan"), ["6: column 'q1' has no number here, where others have one"]),
    "text": (("0.4,0", "0.4,up"), ["6: column 'q1': expected a number, found 'up'"]),
    "negative stiffness": ((ROWS[4], "0.4,0,0,0,9,-9,9\n"), ["6: stiffness2 must be positive, not -9"]),
    "unknown column": (
        ("stiffness3", "stifness3"),
        ["1: unknown column 'stifness3'; did you mean 'stiffness3'?"],
    ),
}


def refused(done, folder, before, file, lines):
    """Check that stderr holds these lines about `file`, and that this is all that happened."""
    assert (done.code, done.out) == (2, "")
    printed = done.err.splitlines()
    assert len(printed) == len(lines), done.err
    for found, expected in zip(printed, lines, strict=True):
        line, part = expected.split(": ", 1)
        assert found.startswith(f"{file}:{line}: " if line else f"{file}: ")
        assert part in found
    assert contents(folder) == before


@pytest.mark.parametrize(("change", "lines"), ROBOT_EDITS.values(), ids=ROBOT_EDITS)
def test_robot(vsacli, tmp_path, change, lines):
    edited(ROBOT, tmp_path / "r.yaml", change)
    before = contents(tmp_path)
    refused(vsacli("invdyn", "r.yaml", REST_TO_REST), tmp_path, before, "r.yaml", lines)


@pytest.mark.parametrize(("change", "lines"), TRAJECTORY_EDITS.values(), ids=TRAJECTORY_EDITS)
def test_trajectory(vsacli, tmp_path, change, lines):
    edited(REST_TO_REST, tmp_path / "t.yaml", change)
    before = contents(tmp_path)
    refused(vsacli("invdyn", ROBOT, "t.yaml"), tmp_path, before, "t.yaml", lines)


@pytest.mark.parametrize(("content", "lines"), ROBOT_FILES.values(), ids=ROBOT_FILES)
def test_file_that_is_no_robot(vsacli, tmp_path, content, lines):
    (tmp_path / "r.yaml").write_bytes(content)
    before = contents(tmp_path)
    refused(vsacli("check-feasibility", "r.yaml", REST_TO_REST), tmp_path, before, "r.yaml", lines)


@pytest.mark.parametrize(("change", "lines"), TABLES.values(), ids=TABLES)
def test_table(vsacli, tmp_path, change, lines):
    (tmp_path / "t.csv").write_text("".join([HEADER, *ROWS]).replace(*change))
    before = contents(tmp_path)
    refused(vsacli("invdyn", ROBOT, "t.csv"), tmp_path, before, "t.csv", lines)


def test_unchanged_table_is_accepted(vsacli, tmp_path):
    (tmp_path / "t.csv").write_text("".join([HEADER, *ROWS]))
    assert vsacli("invdyn", ROBOT, "t.csv").code == 0


@pytest.mark.parametrize("command", ["invdyn", "check-feasibility"])
@pytest.mark.parametrize(
    ("name", "message"),
    [("absent.yaml", "no such file"), (".", "is a folder")],
)
def test_what_is_not_a_file(vsacli, tmp_path, command, name, message):
    for arguments in ((name, REST_TO_REST), (ROBOT, name)):
        done = vsacli(command, *arguments)
        assert (done.code, done.out) == (2, "")
        assert re.fullmatch(f"{re.escape(name)}: {message}.*\n", done.err)
    assert contents(tmp_path) == {}


def test_unreadable_file(vsacli, tmp_path):
    edited(ROBOT, tmp_path / "r.yaml").chmod(0)
    if os.access(tmp_path / "r.yaml", os.R_OK):
        pytest.skip("this user may read everything")
    done = vsacli("invdyn", "r.yaml", REST_TO_REST)
    assert (done.code, done.out) == (2, "")
    assert re.fullmatch(r"r\.yaml: .*[Pp]ermission.*\n", done.err)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["noise.yaml", "noise.csv"])
def test_200_megabytes_of_noise_are_refused_within_seconds(tmp_path, name):
    noise = os.urandom(1_000_000)
    with (tmp_path / name).open("wb") as file:
        for _ in range(200):
            file.write(noise)
    done = installed("invdyn", ROBOT, name, folder=tmp_path, timeout=20)  # seconds; it takes less than one
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"{name}:")
    assert done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.slow
def test_installed_command_refuses_bad_input_without_a_traceback(tmp_path):
    edited(ROBOT, tmp_path / "r.yaml", ("mass: 9.0478", "mass: heavy"))
    done = installed("invdyn", "r.yaml", REST_TO_REST, folder=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch("r[.]yaml:13: mass: expected a number in kg, found 'heavy'.*\n", done.stderr)
    assert contents(tmp_path).keys() == {"r.yaml"}
