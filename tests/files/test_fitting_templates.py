"""New robots with devices of the literature, and with links of given sizes; new studies."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.marks import slow_but

from vsacli import InputError, Robot, inverse_dynamics, load_robot, load_trajectory
from vsacli.actuators.kinds import ACTUATORS, mechanisms_of
from vsacli.files.device_actuators import DEVICES
from vsacli.files.examples import examples, tables_named_in
from vsacli.files.robot_template import LinkSizes, robot_template
from vsacli.files.templates import trajectory_template

FINGER = LinkSizes((0.045, 0.03), (0.025, 0.015))
SIZES = {
    "finger": FINGER,
    "of 1 g": LinkSizes((0.01,), (0.001,)),
    "excavator": LinkSizes((3.0, 2.0), (500.0, 300.0)),
    "length alone": LinkSizes((0.05,)),
    "mass alone": LinkSizes((), (0.1,)),
}

UNSCALED = ("table", "potential", "cam")
"""Mechanisms with a table or a formula, whose numbers are not in the robot file or have no unit."""

SCALED = [
    word
    for kind in ACTUATORS
    for word in (kind, *(f"{kind}:{each}" for each in mechanisms_of(kind) if each not in UNSCALED))
]


def load_taken_for_real(text: str, folder: Path) -> Robot:
    path = folder / "arm.yaml"
    path.write_text(text.replace("placeholder: true", "placeholder: false"))
    return load_robot(path)


@pytest.mark.parametrize("word", slow_but(["qbmove", "compact", "maccepa_vd"], DEVICES))
def test_a_joint_with_a_device(vsacli: Any, word: str) -> None:
    """Its actuator, damper and damping are those of the device's file."""
    assert vsacli("new", "robot", "--joint", f"mcp:{word}", "-o", "arm.yaml").code == 0
    robot, (device,) = load_robot("arm.yaml"), examples([DEVICES[word]])
    joint, expected = robot.joints[0], device.robot.joints[-1]
    for name in ("damper", "damping"):
        assert getattr(joint, name) == getattr(expected, name), name
    numbers, those_of_device = (
        [(number.path[2:], number.value) for number in each.checked.numbers if "actuator" in number.path]
        for each in (robot, device.robot)
    )
    assert numbers == those_of_device[-len(numbers) :]
    tables, those_of_device = (
        [source.text for source in each.actuator.sources] for each in (joint, expected)
    )
    assert tables == those_of_device


def test_a_device_by_the_name_that_the_literature_has(vsacli: Any) -> None:
    assert vsacli("new", "robot", "--joint", "mcp:VSA-II", "-o", "arm.yaml").code == 0
    refused = vsacli("new", "robot", "--joint", "mcp:qbmov")
    assert refused.code == 2
    assert "did you mean 'qbmove' or 'qbmove_gazebo'?" in refused.err
    with pytest.raises(
        InputError, match="joint_1: qbmove turns about an axis, and drives no prismatic joint"
    ):
        robot_template("P", "qbmove")


def test_every_device_of_the_page_has_its_word() -> None:
    page = (REPOSITORY / "docs" / "devices.md").read_text()
    rows = [line.split("|") for line in page.splitlines() if line.startswith("| ") and ".yaml" in line]
    words = [re.findall(r"`(\w+)`", row[2]) for row in rows]
    assert sorted(word for row in words for word in row) == sorted(DEVICES)
    for row, of_row in zip(rows, words, strict=True):
        assert of_row, row
        assert {DEVICES[word] for word in of_row} <= {*re.findall(r"(\w+)\.yaml", row[4])}


@pytest.mark.parametrize("what", slow_but(["finger", "excavator"], SIZES))
@pytest.mark.parametrize("actuator", slow_but(["antagonistic:exponential", "serial:lever", "rigid"], SCALED))
def test_links_of_any_size_get_actuators_that_fit(what: str, actuator: str, tmp_path: Path) -> None:
    """Nothing is implausible, and a new trajectory is feasible."""
    robot = load_taken_for_real(robot_template("RR", actuator, sizes=SIZES[what]), tmp_path)
    assert robot.warnings == ()
    (tmp_path / "move.yaml").write_text(trajectory_template(robot).replace("rate: 1000", "rate: 50  "))
    report = inverse_dynamics(robot, load_trajectory(tmp_path / "move.yaml", robot)).report
    assert report.verdict == "ok"


def test_a_sized_arm_is_similar_to_the_usual_one(tmp_path: Path) -> None:
    """Stiffness scales as the torque of the weight, inertia also as the length; numbers have 3 digits."""
    for actuator in ("antagonistic", "serial:awas", "elastic:sinh"):
        usual = load_taken_for_real(robot_template("RR", actuator), tmp_path).checked
        finger = load_taken_for_real(robot_template("RR", actuator, sizes=FINGER), tmp_path).checked
        for index in range(2):
            ratios = []
            for checked in (usual, finger):
                attainable, load = checked.unloaded_ranges[index], checked.sizes.loads[index]
                inertia = checked.joints[index].actuator.motors[0].inertia
                lever = checked.sizes.levers[index]
                ratios.append([*(attainable or (1, 1)) / np.array(load), inertia / load / lever])
            np.testing.assert_allclose(ratios[1][-1], ratios[0][-1], rtol=0.01)
            if usual.unloaded_ranges[index] is not None:
                np.testing.assert_allclose(ratios[1], ratios[0], rtol=0.02)


def test_sizes_on_the_command_line(vsacli: Any) -> None:
    joints = ("--joint", "mcp:antagonistic:exponential", "--joint", "pip:antagonistic:exponential")
    done = vsacli("new", "robot", *joints, "--length", "0.045,0.03", "--mass", "0.025,0.015", "-o", "f.yaml")
    assert done.code == 0
    robot = load_robot("f.yaml")
    assert [joint.dh.a for joint in robot.joints] == [0.045, 0.03]
    assert [joint.link.mass for joint in robot.joints] == [0.025, 0.015]
    assert [joint.dh.alpha for joint in robot.joints] == [0, 0]  # a planar chain in a vertical plane
    assert robot.gravity == (0, -9.81, 0)
    refused = vsacli("new", "robot", "--joints", "RRR", "--length", "1,2")
    assert "--length: 3 joints, but 2 values; give one value for all links or one for each" in refused.err
    assert "must be positive, not 0" in vsacli("new", "robot", "--joints", "R", "--mass", "0").err


def test_numbers_of_tables_stay(tmp_path: Path) -> None:
    text = robot_template("RR", "antagonistic:table", sizes=FINGER)
    for table in tables_named_in(text):
        shutil.copy(table, tmp_path)
    assert load_taken_for_real(text, tmp_path).joints[0].dh.a == 0.045


@pytest.mark.parametrize(
    ("robot", "trajectory", "varied"),
    [
        ("vsa_3r", "rest_to_rest", "joints.*.actuator.spring.k: {linspace: [320, 480, 5]}"),
        ("mixed_3r", "mixed_3r", "joints.shoulder.actuator.stiffness: {linspace: [800, 1200, 5]}"),
        (
            "qbmove_arm_manual",
            "qbmove_arm",
            "joints.*.actuator.spring.0.k: {linspace: [0.00208, 0.00312, 5]}",
        ),
    ],
)
def test_a_new_study_runs(vsacli: Any, robot: str, trajectory: str, varied: str) -> None:
    for folder, name in (("robots", robot), ("trajectories", trajectory)):
        shutil.copy(REPOSITORY / folder / f"{name}.yaml", f"{folder} of mine.yaml")
    Path("studies").mkdir()
    files = ("robots of mine.yaml", "trajectories of mine.yaml")
    done = vsacli("new", "study", *files, "-o", "studies/study.yaml")
    assert (done.code, done.err.splitlines()[-1]) == (0, "next: vsacli study studies/study.yaml")
    text = Path("studies/study.yaml").read_text()
    assert f"\n  {varied}\n  duration: [" in text
    assert "\nrobot: ../robots of mine.yaml" in text
    quick = re.sub(r"duration: .*", "rate: [20]", text)
    Path("studies/study.yaml").write_text(quick)
    assert vsacli("study", "studies/study.yaml", "--processes", "1").code == 0


def test_a_new_study_of_a_rigid_robot_and_of_awkward_names(vsacli: Any) -> None:
    assert vsacli("new", "robot", "--joints", "R", "--actuator", "rigid", "-o", "a: b.yaml").code == 0
    assert vsacli("new", "trajectory", "--robot", "a: b.yaml", "-o", "move #1.yaml").code == 0
    text = vsacli("new", "study", "a: b.yaml", "move #1.yaml").out
    assert "joints.joint_1.link.mass: {linspace: [1.6, 2.4, 5]}" in text
    assert '\nrobot: "a: b.yaml"' in text
    Path("study.yaml").write_text(re.sub(r"duration: .*", "rate: [20]", text))
    assert vsacli("study", "study.yaml", "--processes", "1").code == 0
