"""`vsacli plot ROBOT`: figures of a robot before any run."""

from __future__ import annotations

from pathlib import Path

import pytest
from samples.command_line import REPOSITORY, ROBOT, SEVEN_JOINTS, contents

NAMES = ("arm", "actuators", "stiffness")


@pytest.mark.slow
def test_a_robot_is_drawn(vsacli, tmp_path):
    done = vsacli("plot", ROBOT, "-o", "figures", "--format", "svg")
    assert done.code == 0
    assert done.err.splitlines() == [f"wrote figures/vsa_3r-{name}.svg" for name in NAMES]
    first = contents(tmp_path)
    assert first.keys() == {f"figures/vsa_3r-{name}.svg" for name in NAMES}
    vsacli("plot", ROBOT, "-o", "figures", "--format", "svg", "--overwrite")
    assert contents(tmp_path) == first


def test_of_rigid_joints_only_the_arm_is_drawn_and_a_note_says_so(vsacli, tmp_path):
    robot = (REPOSITORY / "robots" / "mixed_3r.yaml").read_text(encoding="utf-8")
    start, *joints = robot.split("  - name: ")
    (tmp_path / "rigid.yaml").write_text("  - name: ".join((start, joints[0])), encoding="utf-8")
    done = vsacli("plot", "rigid.yaml")
    assert done.code == 0
    assert "rigid.yaml: no figures of actuators and stiffness: all joints are rigid" in done.err
    assert contents(tmp_path).keys() == {"rigid.yaml", "rigid-arm.png"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--from", "1"], "--from cannot be used with a robot; leave it out"),
        (["--joints", "elbow"], "--joints cannot be used with a robot; leave it out"),
        (["--robot", ROBOT], "--robot is only for recordings; leave it out"),
        ([SEVEN_JOINTS], "robots are drawn one at a time"),
    ],
)
def test_options_of_results_are_refused(vsacli, tmp_path, options, message):
    done = vsacli("plot", ROBOT, *options)
    assert done.code == 2
    assert message in " ".join(done.err.split())
    assert contents(tmp_path) == {}


def test_an_invalid_robot_is_refused_with_the_line(vsacli, tmp_path):
    text = ROBOT.read_text(encoding="utf-8").replace("type: revolute", "type: revolving", 1)
    (tmp_path / "bad.yaml").write_text(text, encoding="utf-8")
    done = vsacli("plot", "bad.yaml")
    assert done.code == 2
    assert done.err.startswith("bad.yaml:")
    assert "revolving" in done.err


@pytest.mark.slow
def test_a_page_has_the_figures_parameters_and_file_of_a_robot(vsacli):
    assert vsacli("plot", ROBOT, "-o", "arm.html").code == 0
    page = Path("arm.html").read_text(encoding="utf-8")
    assert page.count('src="data:image/svg+xml;base64,') == 3
    assert "<h1>vsa-3r</h1>" in page
    assert "format: vsacli-robot/1" in page
    assert "<script" not in page
