"""Damaged files of every kind, as `validate` and `info` meet them: messages, soon, and never an exception."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from samples.command_line import REPOSITORY, ROBOT
from samples.hostile import CSV, XML, YAML, damaged, fuzz
from samples.marks import slow

from vsacli import InputError
from vsacli.base.json_records import json_value
from vsacli.files.info import describe_file
from vsacli.files.info.text import render
from vsacli.files.validation import check_files
from vsacli.robot.urdf.reader import read_urdf

pytestmark = pytest.mark.usefixtures("own_folder")

TIMES = np.linspace(0, 1, 12)
RECORDING = "time,base.q,shoulder.q,elbow.q,base.stiffness,shoulder.stiffness,elbow.stiffness\n" + "".join(
    f"{t:.4g},{np.sin(t):.6g},{t * t:.6g},0.5,1000,{1000 + t:.6g},1000\n" for t in TIMES
)
NUMBERED = "# a comment\ntime;q1[deg];stiffness1\n" + "".join(f"{t:.4g};{t * t:.6g};1000\n" for t in TIMES)
SPRING = (REPOSITORY / "robots" / "measured_spring.csv").read_text()
POLES = "format: vsacli-poles/1\njoints:\n  - {name: base, position: '-20,-21,-3+4j,-3-4j', stiffness: -20}\n"
URDF = """<robot name="arm">
  <link name="a"><inertial>
    <mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="b"/>
  <joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 1" rpy="0 0.5 0"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="9" velocity="2"/></joint>
</robot>
"""
TRAJECTORIES = sorted((REPOSITORY / "trajectories").glob("*.yaml"))
LONGEST = 10_000
"""Characters of all messages on one small file."""


def look_at(name: str, text: str) -> None:
    """What the commands do with a file, alone and beside a robot."""
    Path(name).write_text(text, encoding="utf-8", errors="surrogatepass", newline="")
    for paths in ([name], [str(ROBOT), name]):
        checked = check_files(paths)[-1]
        assert len("\n".join(map(str, checked.messages))) < LONGEST
        assert bool(checked.summary) == checked.passed
    try:
        description = describe_file(name, str(ROBOT) if "base" in text else None)
    except InputError:
        return
    json_value(description)
    assert render(description)


@pytest.mark.slow
@fuzz(60)
@given(damaged(RECORDING, CSV) | damaged(NUMBERED, CSV))
def test_any_recording(text: str) -> None:
    look_at("motion.csv", text)


@pytest.mark.slow
@fuzz(60)
@given(damaged(SPRING, CSV))
def test_any_spring_table(text: str) -> None:
    look_at("spring.csv", text)


@pytest.mark.slow
@fuzz(60)
@given(damaged(POLES, YAML))
def test_any_poles(text: str) -> None:
    look_at("poles.yaml", text)


@pytest.mark.slow
@fuzz(60)
@given(st.data())
def test_any_trajectory_that_comes_along(data: Any) -> None:
    text = data.draw(st.sampled_from(TRAJECTORIES)).read_text()
    few = text.replace("rate: 1000", "rate: 20  ").replace("rate: 500 ", "rate: 20  ")
    look_at("move.yaml", data.draw(damaged(few, YAML)))


@pytest.mark.slow
@fuzz(100)
@given(damaged(URDF, XML))
def test_any_urdf(text: str) -> None:
    look_at("arm.urdf", text)


@fuzz(100)
@given(st.binary(max_size=200), st.sampled_from(["f", "f.csv", "f.yaml", "f.urdf", "f.h5"]))
def test_any_bytes_under_any_name(content: bytes, name: str) -> None:
    Path(name).write_bytes(content)
    (checked,) = check_files([name])
    assert checked.passed is False
    assert all(message.file == name for message in checked.messages)


BOMB = "<!DOCTYPE r [<!ENTITY a0 'ha'>" + "".join(
    f"<!ENTITY a{i} '{f'&a{i - 1};' * 10}'>" for i in range(1, 12)
)


@pytest.mark.parametrize(
    "text",
    [
        BOMB + "]><robot name='&a11;'/>",
        "<!DOCTYPE r [<!ENTITY f SYSTEM 'file:///etc/passwd'>]><robot name='&f;'/>",
        "<!DOCTYPE r SYSTEM 'http://localhost/evil.dtd'><robot name='r'/>",
        "<a>" * 100_000,
        slow("<robot " + " ".join(f"a{i}='1'" for i in range(100_000)) + "/>"),
        "<robot name='" + "x" * 1_000_000 + "'/>",
        slow("<robot>" + "<link name='a'/>" * 100_000 + "</robot>"),
    ],
    ids=["entity bomb", "file entity", "external DTD", "deep", "many attributes", "long name", "many links"],
)
def test_urdfs_that_mean_harm(text: str) -> None:
    Path("evil.urdf").write_text(text)
    with pytest.raises(InputError) as caught:
        read_urdf("evil.urdf")
    assert len(str(caught.value)) < LONGEST
    assert "root:" not in str(caught.value)


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="the system has no /dev/zero")
def test_devices_and_folders_are_no_files(vsacli: Any) -> None:
    os.mkdir("folder")
    done = vsacli("validate", "/dev/zero", "folder", "a\0b")
    assert done.code == 2
    assert done.out.splitlines() == [
        "/dev/zero: is not a regular file (a device, pipe or socket)",
        "folder: is a folder; give the name of a file in it",
        "a\\x00b: the path holds a NUL character",
    ]
