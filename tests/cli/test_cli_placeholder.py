"""A robot whose springs and motors are placeholders: every report says so, until the key is removed."""

from __future__ import annotations

import json
import re

import pytest
from samples.command_line import REPOSITORY
from samples.urdf import write

from vsacli import InputError, load_robot
from vsacli.robot.model import PLACEHOLDER_WARNING

KEY = "placeholder: true\n"
ARM = (REPOSITORY / "robots" / "vsa_3r.yaml").read_text(encoding="utf-8")
MOTION = """\
format: vsacli-trajectory/1
name: short
duration: 0.1
rate: 1000
position: {type: polynomial, degree: 9, start: 0, end: 0.001}
stiffness: {type: constant, value: 1200}
"""


@pytest.fixture
def arm(tmp_path):
    write(tmp_path / "short.yaml", MOTION)
    return write(tmp_path / "arm.yaml", ARM + KEY)


@pytest.mark.parametrize(
    "words",
    [
        ("invdyn", "arm.yaml", "short.yaml", "-o", "arm.h5"),
        ("check-feasibility", "arm.yaml", "short.yaml"),
        ("simulate", "arm.yaml", "short.yaml"),
        ("validate", "arm.yaml"),
        ("info", "arm.yaml"),
        ("codegen", "arm.yaml", "-o", "controller"),
    ],
    ids=lambda words: words[0],
)
def test_each_command_says_so_until_the_key_is_removed(vsacli, arm, words):
    done = vsacli(*words)
    assert done.code == 0, done.err
    assert f"warning: {PLACEHOLDER_WARNING}" in re.sub(r"\s+", " ", done.out + done.err)
    write(arm, ARM)
    again = vsacli(*words, *(() if words[0] in ("validate", "info") else ("--overwrite",)))
    assert again.code == 0, again.err
    assert "placeholder" not in again.out + again.err


@pytest.mark.usefixtures("arm")
@pytest.mark.parametrize("words", [("invdyn", "arm.yaml", "short.yaml"), ("info", "arm.yaml")])
def test_data_say_so(vsacli, words):
    assert json.loads(vsacli(*words, "--json").out)["warnings"] == [PLACEHOLDER_WARNING]


def test_generated_code_says_so(vsacli, arm, tmp_path):
    assert vsacli("codegen", arm, "-o", "controller").code == 0
    build = {"Makefile", "CMakeLists.txt"}
    files = [path for path in (tmp_path / "controller").iterdir() if path.name not in build]
    assert len(files) == 7
    for path in files:
        text = path.read_text().replace("\\", "")  # with which Markdown says that a letter is only a letter
        assert PLACEHOLDER_WARNING in re.sub(r"\s+(# )?", " ", text)


def test_results_keep_it(vsacli, arm):
    assert vsacli("invdyn", arm, "short.yaml", "-o", "arm.h5").code == 0
    assert f"warning: {PLACEHOLDER_WARNING}" in re.sub(r"\s+", " ", vsacli("info", "arm.h5").out)


@pytest.mark.parametrize("word", ["yes", "1", "True", '"true"', "[true]", "", "null"])
def test_only_true_and_false_are_read(tmp_path, word):
    text = ARM + f"placeholder: {word}\n"
    with pytest.raises(InputError, match=r"placeholder: expected true or false, found "):
        load_robot(write(tmp_path / "arm.yaml", text))


def test_a_robot_may_say_that_it_is_none(tmp_path):
    robot = load_robot(write(tmp_path / "arm.yaml", ARM + "placeholder: false\n"))
    assert not robot.placeholder
    assert robot.replace("placeholder", True).warnings == (PLACEHOLDER_WARNING,)
    with pytest.raises(InputError, match="placeholder: expected true or false, found 'perhaps'"):
        robot.replace("placeholder", "perhaps")
