"""`vsacli plot ROBOT`: figures of a robot before any run."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from samples.command_line import REPOSITORY, ROBOT, SEVEN_JOINTS, contents
from samples.pages import Page

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
        (["--robot", ROBOT], "--robot is only for"),
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


@pytest.mark.slow
def test_sliders_end_at_the_position_limits(vsacli, tmp_path):
    """Without them, half a turn or the size of the arm from home, which is 0 if the limits allow it."""
    link = "{mass: 1, com: [0, 0, 0], inertia: {xx: 1, yy: 1, zz: 1}}"
    row = f"dh: {{a: 0.3, alpha: 0}}, link: {link}, actuator: {{type: rigid, motor: {{inertia: 1}}}}"
    joints = [
        ("free", "revolute", ""),
        ("slide", "prismatic", ""),
        ("above", "revolute", ", limits: {position: [0.5, 1.5]}"),
        ("around", "revolute", ", limits: {position: [-1, 0.2]}"),
    ]
    lines = [f"  - {{name: {name}, type: {kind}, {row}{limits}}}\n" for name, kind, limits in joints]
    text = "format: vsacli-robot/1\nname: ends\njoints:\n" + "".join(lines)
    (tmp_path / "ends.yaml").write_text(text, encoding="utf-8")
    assert vsacli("plot", "ends.yaml", "-o", "ends.html").code == 0
    page = Page(Path("ends.html"))
    sliders = {joint["name"]: (joint["home"], *joint["range"]) for joint in page.data["joints"]}
    home, low, high = sliders.pop("slide")
    assert 0 == home < high == -low < 1.2  # the lengths of all links
    assert sliders == {
        "free": (0, -math.pi, math.pi),
        "above": (1, 0.5, 1.5),
        "around": (0, -1, 0.2),
    }
