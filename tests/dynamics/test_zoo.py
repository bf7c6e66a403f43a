"""The dynamics of the shipped robots against numbers of others: Pinocchio, a textbook, published tables."""

from __future__ import annotations

import importlib.metadata
import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
from oracles import pinocchio
from oracles.kinematics import tool_pose
from oracles.urdf_pinocchio import UrdfOracle
from samples.robots import at_rest, random_motion
from samples.shipped import EXAMPLES, shipped_robot

from vsacli import Robot, link_torques, mass_matrix
from vsacli.actuators.drivetrain import Drivetrain
from vsacli.files.examples import Example

ROUNDING = 1e-12
"""Relative to the largest: two different sums of some hundred terms, each good to 1e-16."""

PRINTED = 5.1e-5
"""Half of the last of four printed decimals."""

PANDA_JOINTS = [f"panda_joint{number}" for number in range(1, 8)]
UR_JOINTS = [
    f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
]


def static_load(robot: Robot, *q: float) -> np.ndarray:
    return link_torques(robot, *at_rest(robot, np.array([q])))[0][0]


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def urdf(package: str, name: str) -> Path:
    """A URDF file of the package example-robot-data."""
    try:
        files = importlib.metadata.files("example-robot-data") or []
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("could not import 'example-robot-data'")
    [found] = [file for file in files if file.parts[-3:] == (package, "urdf", name)]
    return Path(str(found.locate()))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_link_torques_are_those_of_pinocchio(example: Example):
    robot = example.robot
    motion = random_motion(robot, 20, seed=4)
    tau_e, dtau_e, _ = link_torques(robot, *motion)
    assert relative(tau_e, pinocchio.torques(robot, *motion[:3])) < ROUNDING
    assert relative(dtau_e, pinocchio.torque_rates(robot, *motion[:4])) < ROUNDING


@pytest.mark.parametrize(
    ("pose", "torques"),
    [
        ((0, math.pi / 4, math.pi, 0, math.pi / 4, 0), (0, 31.6399, 6.0351, 0, 0.0283, 0)),
        ((0, 0, 0, 0, 0, 0), (0, 37.4837, 0.2489, 0, 0, 0)),
        ((0, math.pi / 2, -math.pi / 2, 0, 0, 0), (0, -0.7752, 0.2489, 0, 0, 0)),
    ],
    ids=["nominal", "zero", "ready"],
)
def test_the_static_load_of_the_puma_is_the_published_one(
    pose: tuple[float, ...], torques: tuple[float, ...]
):
    """As the Robotics Toolbox computes it (P. Corke, Robotics, Vision and Control, 2011)."""
    assert static_load(shipped_robot("puma_560"), *pose) == pytest.approx(torques, abs=PRINTED)


def test_the_mass_matrix_of_the_puma_with_its_rotors_is_the_published_one():
    """At the nominal pose, as printed in P. Corke, Robotics, Vision and Control, 2011."""
    robot = shipped_robot("puma_560")
    drivetrain = Drivetrain(robot.actuators)
    rotors = np.array([drivetrain.inertia[drivetrain.joint == joint][0] for joint in range(6)])
    q = np.array([0, math.pi / 4, math.pi, 0, math.pi / 4, 0])
    published = [
        [3.6594, -0.4044, 0.1006, -0.0025, 0.0000, 0.0000],
        [-0.4044, 4.4137, 0.3509, 0.0000, 0.0024, 0.0000],
        [0.1006, 0.3509, 0.9378, 0.0000, 0.0015, 0.0000],
        [-0.0025, 0.0000, 0.0000, 0.1925, 0.0000, 0.0000],
        [0.0000, 0.0024, 0.0015, 0.0000, 0.1713, 0.0000],
        [0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.1941],
    ]
    np.testing.assert_allclose(mass_matrix(robot, q) + np.diag(rotors), published, rtol=0, atol=PRINTED)
    assert rotors == pytest.approx([0.784, 2.325, 0.577, 0.191, 0.171, 0.194], abs=5e-4)  # three decimals


def test_the_planar_arm_obeys_the_equations_of_the_textbook():
    """Siciliano et al. (2009), section 7.3.2, but for the rotors, and with two motors of 5 kg at joint 2."""
    robot = shipped_robot("planar_2r")
    q, dq, ddq, *_ = motion = random_motion(robot, 20, seed=7)
    length, middle, mass, inertia, motors, g = 1.0, 0.5, 50.0, 10.0, 10.0, 9.81
    (c1, c2), c12, s2 = np.cos(q).T, np.cos(q.sum(axis=1)), np.sin(q[:, 1])
    coupled = inertia + mass * (middle**2 + length * middle * c2)
    first = 2 * inertia + mass * (2 * middle**2 + length**2 + 2 * length * middle * c2) + motors * length**2
    second = inertia + mass * middle**2
    h = -mass * length * middle * s2
    load = mass * middle * g * c12
    expected = [
        first * ddq[:, 0]
        + coupled * ddq[:, 1]
        + h * (2 * dq[:, 0] * dq[:, 1] + dq[:, 1] ** 2)
        + (mass * middle + motors * length + mass * length) * g * c1
        + load,
        coupled * ddq[:, 0] + second * ddq[:, 1] - h * dq[:, 0] ** 2 + load,
    ]
    assert relative(link_torques(robot, *motion)[0], np.array(expected).T) < ROUNDING


@pytest.mark.slow
def test_the_panda_is_that_of_its_robot_description(tmp_path: Path):
    """Kinematics and torques, without the hand."""
    document = ElementTree.parse(urdf("panda_description", "panda.urdf"))
    root = document.getroot()
    kept = {"world", *(f"panda_link{number}" for number in range(9))}
    for element in [*root.findall("link"), *root.findall("joint")]:
        child = element.find("child")
        if (element.get("name") if child is None else child.get("link")) not in kept:
            root.remove(element)
    document.write(tmp_path / "arm.urdf")
    oracle = UrdfOracle(tmp_path / "arm.urdf")
    robot = shipped_robot("panda_7r")
    motion = random_motion(robot, 10, seed=2)
    poses = [tool_pose(robot, q).real for q in motion[0]]
    expected = [oracle.tip_pose(PANDA_JOINTS, "panda_link0", "panda_link8", q) for q in motion[0]]
    # The description prints right angles with twelve decimals.
    np.testing.assert_allclose(poses, expected, rtol=0, atol=1e-10)
    torques = [oracle.torques(PANDA_JOINTS, *instant) for instant in zip(*motion[:3], strict=True)]
    assert relative(link_torques(robot, *motion)[0], np.array(torques)) < 1e-10  # likewise


@pytest.mark.slow
def test_the_ur5_has_the_kinematics_of_its_robot_description():
    oracle = UrdfOracle(urdf("ur_description", "ur5_robot.urdf"))
    robot = shipped_robot("ur5_6r")
    for q in random_motion(robot, 10, seed=2)[0]:
        # The description prints some right angles with nine decimals.
        expected = oracle.tip_pose(UR_JOINTS, "base", "tool0", q)
        np.testing.assert_allclose(tool_pose(robot, q).real, expected, rtol=0, atol=1e-8)


def test_the_slide_of_the_scara_points_down_and_carries_its_load():
    """1.2 kg and 0.8 kg hang from the screw, wherever the arm stands; nothing else feels their weight."""
    robot = shipped_robot("scara_4")
    q = (0.3, -1.1, 0.12, 2.0)
    assert static_load(robot, *q) == pytest.approx([0, 0, -2.0 * 9.81, 0], abs=1e-12)  # rounding of 20 N
    tip = tool_pose(robot, np.array(q)).real
    x, y = (0.325 * trig(0.3) + 0.275 * trig(0.3 - 1.1) for trig in (math.cos, math.sin))
    assert tip[:3, 3] == pytest.approx([x, y, 0.35 - 0.12 - 0.06], abs=1e-14)
    assert tip[:3, 2] == pytest.approx([0, 0, -1], abs=1e-14)
