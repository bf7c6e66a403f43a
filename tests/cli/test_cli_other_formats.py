"""Files of other programs where ours are expected: one sentence says what they are, and what to do."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT, Outcome
from samples.urdf import serial

from vsacli import InputError, load_robot

Command = Callable[..., Outcome]

CONVERT = "vsacli import-urdf arm.urdf -o arm.yaml"

FILES = {
    "arm.urdf": (
        f'<?xml version="1.0"?>\n<!-- <a/> -->{serial("RR")}'.encode(),
        f"is a URDF; .* {CONVERT}",
    ),
    "arm.urdf.xacro": (b"<robot/>", f"is a xacro file; .*: xacro arm.urdf.xacro > arm.urdf, then {CONVERT}"),
    "arm.srdf": (b'<robot name="a"><group name="arm"/></robot>', f"{CONVERT} --srdf arm.srdf --group NAME"),
    "arm.xml": (
        b'\xef\xbb\xbf<mujoco model="arm"/>',
        f"is a model of MuJoCo, which is not .*: {CONVERT}",
    ),
    "arm.sdf": (b"<sdf version='1.9'/>", "is an SDF, which is not read"),
    "arm.mat": (b"MATLAB 5.0 MAT-file, Platform", r"is a file of MATLAB; .*writetable\(t, 'arm.csv'\)"),
    "arm.bag": (b"#ROSBAG V2.0\n\x00\x01", r"rostopic echo -b arm.bag -p /joint_states > arm.csv, then see"),
    "arm.mcap": (b"\x89MCAP0\r\n\x00", "is a bag of ROS 2; .*ros2 topic echo --csv /joint_states > arm.csv"),
    "arm.db3": (b"SQLite format 3\x00", "is a bag of ROS 2"),
    "arm.parquet": (b"PAR1\x15\x04", "is a Parquet file; .* then see vsacli info arm.csv"),
    "arm.npz": (b"PK\x03\x04\x00", "is an array of NumPy"),
    "arm.xlsx": (b"PK\x03\x04\x00", "is a spreadsheet; save it as CSV"),
}


@pytest.mark.parametrize("name", FILES)
def test_as_robot_as_trajectory_and_as_recording(tmp_path: Path, vsacli: Command, name: str) -> None:
    content, sentence = FILES[name]
    (tmp_path / name).write_bytes(content)
    (tmp_path / "motion.yaml").write_text(
        "format: vsacli-trajectory/1\nname: recorded\n"
        f"position: {{type: csv, file: {name}}}\nstiffness: {{type: constant, value: 1000}}\n"
    )
    for command in (("invdyn", name, REST_TO_REST), ("invdyn", ROBOT, name), ("info", name)):
        done = vsacli(*command)
        assert (done.code, done.out) == (2, "")
        assert_said(done.err, sentence)
    assert_said(vsacli("check-feasibility", ROBOT, "motion.yaml").err, sentence)


def assert_said(err: str, sentence: str) -> None:

    (line,) = err.splitlines()
    assert re.search(sentence, line), line


def test_names_that_a_shell_would_take_apart_are_quoted(tmp_path: Path) -> None:
    (tmp_path / "my arm.urdf").write_text(serial("RR"))
    with pytest.raises(InputError, match=r"import-urdf '.*my arm.urdf' -o 'my arm.yaml'$"):
        load_robot(tmp_path / "my arm.urdf")


def test_files_of_ours_are_told_what_is_wrong_with_them(tmp_path: Path, vsacli: Command) -> None:
    (tmp_path / "arm.bag").write_text("format: vsacli-robot/2\n")
    assert "format: expected 'vsacli-robot/1'" in vsacli("invdyn", "arm.bag", REST_TO_REST).err
    assert vsacli("validate", REPOSITORY / "robots" / "desk_arm.urdf").code == 0


def test_files_in_packages_of_ros(vsacli: Command) -> None:
    done = vsacli("import-urdf", "package://my_robot/urdf/arm.urdf")
    assert done.code == 2
    assert "give the path, $(ros2 pkg prefix --share my_robot)/urdf/arm.urdf" in done.err
