"""`vsacli info` of a tree, and its representations in Python."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
import yaml
from samples.command_line import REPOSITORY
from samples.torso import torso_text, written

from vsacli import load_robot, open_result


def cells(text: str, header: str) -> list[list[str]]:
    """The rows of the table that begins with this header, up to a line without cells."""
    lines = text.splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith(header))
    table = []
    for line in lines[first:]:
        row = [cell.strip() for cell in line.split("   ") if cell.strip()]
        if len(row) < 2:
            break
        table.append(row)
    return table


def test_info_says_what_carries_each_joint_and_tool(vsacli, own_folder):
    text = vsacli("info", written(own_folder, torso_text())).out
    header, *joints = cells(text, "joint")
    assert header[:3] == ["joint", "on", "type"]
    assert [row[:2] for row in joints] == [
        ["waist", "frame 0"],
        ["left_shoulder", "waist"],
        ["left_arm", "left_shoulder"],
        ["left_elbow", "left_arm"],
        ["right_shoulder", "waist"],
        ["right_arm", "right_shoulder"],
        ["right_elbow", "right_arm"],
        ["pole", "frame 0"],
    ]
    assert cells(text, "mount of")[1:] == [
        ["left_shoulder", "0 0.2 0", "-1.5708 0 0"],
        ["right_shoulder", "0 -0.2 0", "1.5708 0 0"],
        ["pole", "-0.2 0 0.1", "0 0 0"],
    ]
    # bounds: 0.4 up and 0.2 aside to the shoulder, 0.55 of arm, 0.1 to the hand
    assert [row[:2] + row[5:] for row in cells(text, "tool")[1:3]] == [
        ["left_hand", "left_elbow", "1.25"],
        ["right_hand", "right_elbow", "1.15"],
    ]


def test_json_has_the_parent_of_each_joint_and_the_reach_of_each_tool(vsacli, own_folder):
    described = json.loads(vsacli("info", written(own_folder, torso_text()), "--json").out)
    assert [joint["parent"] for joint in described["joints"]] == [
        *(None, "waist", "left_shoulder", "left_arm", "waist", "right_shoulder", "right_arm", None)
    ]
    assert "mount" not in described["joints"][0]
    # the lamp turns about a vertical axis: 0.4 up, at most 0.2 + 0.1 aside
    assert described["reach"]["lamp"]["found"] == pytest.approx(math.hypot(0.4, 0.3))


def test_without_tools_there_is_no_reach(vsacli, own_folder):
    path = written(own_folder, torso_text().split("tools:")[0])
    assert json.loads(vsacli("info", path, "--json").out)["reach"] is None
    text = vsacli("info", path).out
    assert "reach" not in text
    assert not [line for line in text.splitlines() if line.startswith("tool")]


def test_representations_say_what_carries_and_is_carried(own_folder):
    robot = load_robot(written(own_folder, torso_text()))
    header, *rows = cells(repr(robot), "joint")
    assert header == ["joint", "type", "actuator", "on", "tools"]
    assert rows[3] == ["left_elbow", "revolute", "antagonistic", "left_arm", "left_hand"]
    assert rows[-1] == ["pole", "revolute", "antagonistic", "frame 0", "lamp"]
    assert "<td>left_hand</td>" in robot._repr_html_()


@pytest.mark.slow
def test_columns_of_wrenches_by_tool_need_no_robot(vsacli, own_folder):
    """Tools are those that the columns name; a proposed trajectory has their wrenches as a comment."""
    inputs = [REPOSITORY / folder / "hand_3x2r.yaml" for folder in ("robots", "trajectories")]
    vsacli("invdyn", *inputs, "--set", "rate=50", "-o", "grasp.h5")
    vsacli("export", "grasp.h5", "--variables", "q,stiffness,wrench", "-o", "grasp.csv")
    assert vsacli("validate", "grasp.csv").code == 0
    for robot in ((), ("--robot", inputs[0])):
        text = vsacli("info", "grasp.csv", *robot, "--field", "trajectory").out
        assert "ignore" not in text
        assert yaml.safe_load(text)["position"] == {
            "type": "csv",
            "file": "grasp.csv",
        }
        assert '#   thumb_tip: {type: csv, frame: ..., file: "grasp.csv"}' in text
        (own_folder / "again.yaml").write_text(re.sub("# ( *[a-z_]+:)", r"\1", text).replace("...", "base"))
        assert vsacli("invdyn", inputs[0], "again.yaml", "-o", "again.h5", "--overwrite").code == 0
    with open_result("grasp.h5") as first, open_result("again.h5") as again:
        np.testing.assert_array_equal(again.wrench, first.wrench)
