"""Exported URDF: read back it has the same kinematics and link torques, by this program and by Pinocchio."""

from __future__ import annotations

import dataclasses
import math
import xml.etree.ElementTree as ElementTree
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from samples.marks import slow
from samples.robots import ODD_GRAVITY, random_motion, random_robot, robot_of_ones, vsa_3r
from samples.shipped import shipped_robot

from vsacli import (
    Damper,
    Elastic,
    Friction,
    Limits,
    Motor,
    Placeholders,
    Pose,
    forward_kinematics,
    import_urdf,
    link_torques,
)
from vsacli.robot.models.urdf import NO_LIMIT, urdf_model

ROUNDING = 1e-9
"""Of torques, relative to the largest: angles in text are exact, but frames are turned to them and back, and
almost parallel axes are told apart by 1e-4 rad, which divides the digits of a length."""

BASE, TOOL = Pose(xyz=(0.3, -0.2, 0.5), rpy=(0.3, -0.7, 2.1)), Pose(xyz=(0.1, 0.2, 0.3), rpy=(1.0, 0.2, -0.4))


def imported(robot, tmp_path):
    """What `import-urdf` makes of the exported file, under the gravity of the robot."""
    path = tmp_path / "robot.urdf"
    path.write_text(urdf_model(robot).text)
    found = import_urdf(path, placeholders=Placeholders("rigid")).robot
    return dataclasses.replace(found, gravity=robot.gravity)


def check_same(robot, other):
    motion = random_motion(robot, 10, seed=3)
    for found, expected in zip(link_torques(other, *motion), link_torques(robot, *motion), strict=True):
        np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())
    ends = (forward_kinematics(each, motion[0])[:, -1] for each in (other, robot))
    np.testing.assert_allclose(*ends, atol=ROUNDING)  # of lengths of about 1 m


@pytest.mark.parametrize("name", ["vsa_3r", "puma_560", "scara_4", slow("panda_7r"), slow("ur5_6r")])
def test_shipped_robots_come_back(name, tmp_path):
    robot = shipped_robot(name)
    bare = dataclasses.replace(
        robot, joints=tuple(dataclasses.replace(joint, friction=None) for joint in robot.joints)
    )
    check_same(bare, imported(bare, tmp_path))


CHAINS = [(types, seed) for types in ("RRR", "RPRP", "PPR") for seed in range(3)]


@pytest.mark.parametrize(("types", "seed"), [slow(*chain) if chain[1] else chain for chain in CHAINS])
def test_random_chains_come_back(types, seed, tmp_path):
    robot = dataclasses.replace(random_robot(types, seed), base=BASE, tool=TOOL)
    check_same(robot, imported(robot, tmp_path))


def test_rods_lie_between_the_origins():
    """Both ends of each cylinder are origins of frames i - 1 and i."""
    robot, q = dataclasses.replace(robot_of_ones("RRPR"), base=BASE), np.zeros(4)
    origins = [np.array(BASE.xyz), *forward_kinematics(robot, q)[:-1, :3, 3]]
    links = {link.get("name"): link for link in ElementTree.fromstring(urdf_model(robot).text).iter("link")}
    for joint, pose, ends in zip(robot.joints, forward_kinematics(robot, q), pairwise(origins), strict=False):
        visual = links[f"{joint.name}_link"].find("visual")
        (x, y, z), (_, pitch, _) = (
            map(float, visual.find("origin").get(name).split()) for name in ("xyz", "rpy")
        )
        half = float(visual.find("geometry/cylinder").get("length")) / 2
        axis = half * np.array([math.sin(pitch), 0, math.cos(pitch)])
        to_link = np.linalg.inv(rotation_x(joint.dh.alpha))  # from the frame of the link to frame i
        for end, sign in zip(ends, (-1, 1), strict=True):
            local = to_link @ (np.array([x - joint.dh.a, y, z]) + sign * axis)
            np.testing.assert_allclose(pose[:3, :3] @ local + pose[:3, 3], end, atol=1e-14)


def test_a_link_without_length_is_a_ball():
    robot = robot_of_ones("R")
    row = dataclasses.replace(robot.joints[0].dh, a=0, d=0)
    robot = dataclasses.replace(robot, joints=(dataclasses.replace(robot.joints[0], dh=row),))
    (geometry,) = ElementTree.fromstring(urdf_model(robot).text).iter("geometry")
    assert [each.tag for each in geometry] == ["sphere"]
    assert float(geometry[0].get("radius")) > 0


def rotation_x(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def test_pinocchio_reads_it(tmp_path):
    robot = dataclasses.replace(random_robot("RPRR", 7), base=BASE, tool=TOOL)
    path = tmp_path / "robot.urdf"
    robot = dataclasses.replace(
        robot,
        joints=tuple(
            dataclasses.replace(joint, damping=0.0, limits=Limits(position=(-9, 9))) for joint in robot.joints
        ),
    )
    path.write_text(urdf_model(robot).text)
    model = pin.buildModelFromUrdf(str(path))
    model.gravity.linear = np.array(ODD_GRAVITY)
    data = model.createData()
    assert list(model.names)[1:] == list(robot.joint_names)
    motion = random_motion(robot, 5, seed=2)
    expected = link_torques(robot, *motion)[0]
    for q, dq, ddq, torque in zip(*motion[:3], expected, strict=True):
        np.testing.assert_allclose(pin.rnea(model, data, q, dq, ddq), torque, rtol=0, atol=1e-11)
        pin.framesForwardKinematics(model, data, q)
        pose = data.oMf[model.getFrameId("tool")]
        np.testing.assert_allclose(pose.homogeneous, forward_kinematics(robot, q)[-1], atol=1e-13)


def test_limits_damping_and_friction():
    joint = dataclasses.replace(
        vsa_3r().joints[0],
        limits=Limits(position=(-1, 2), velocity=(-3, 2.5), stiffness=(810, 2000)),
        damping=0.3,
        friction=Friction(coulomb=(0.7, 0.7), width=0.01),
        actuator=Elastic(motor=Motor(inertia=1, max_torque=12), stiffness=500),
        damper=Damper(location="link", range=(0, 2)),
    )
    robot = dataclasses.replace(vsa_3r(), joints=(joint,), gravity=(0, 0, -1.62))
    exported = urdf_model(robot)
    element = ElementTree.fromstring(exported.text).find("joint")
    assert element.get("type") == "revolute"
    assert element.find("dynamics").attrib == {"damping": "0.3", "friction": "0.7"}
    assert element.find("limit").attrib == {"effort": "12", "velocity": "2.5", "lower": "-1", "upper": "2"}
    assert [note.partition(" (base)")[0].partition(":")[0] for note in exported.notes] == [
        "motors and springs are left out",
        "gravity, [0, 0, -1.62] m/s^2, is left out",
        *["left out"] * 4,
    ]
    joint = dataclasses.replace(joint, type="prismatic", limits=Limits(), friction=None, damper=None)
    prismatic = ElementTree.fromstring(urdf_model(dataclasses.replace(robot, joints=(joint,))).text)
    limit = prismatic.find("joint/limit")
    assert [float(limit.get(name)) for name in ("lower", "upper", "velocity")] == [
        -NO_LIMIT,
        NO_LIMIT,
        NO_LIMIT,
    ]


def test_any_name_and_any_joint(tmp_path):
    """Joints may be called as the links at the ends are."""
    robot = random_robot("RRRR", 1)
    names = ("world", "tool", "base", "base_link")
    joints = tuple(
        dataclasses.replace(joint, name=name) for joint, name in zip(robot.joints, names, strict=True)
    )
    wicked = dataclasses.replace(robot, name="a<b>&\"'é🤖 -- >", joints=joints)
    assert imported(wicked, tmp_path).joint_names == names
    check_same(wicked, imported(wicked, tmp_path))


def test_links_without_mass_are_written():
    robot = shipped_robot("puma_560")
    assert robot.joints[0].link.mass == 0
    text = urdf_model(robot).text
    assert math.isclose(float(ElementTree.fromstring(text).find(".//mass").get("value")), 0)
