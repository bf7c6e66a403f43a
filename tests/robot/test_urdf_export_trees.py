"""Trees exported as URDF: Pinocchio and `import-urdf` find the same kinematics and torques; names, rods."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
import pytest
from samples.robots import ODD_GRAVITY, random_motion
from samples.shipped import shipped_robot
from samples.trees import random_tree, without_resistance

from vsacli import Limits, Placeholders, Tool, forward_kinematics, import_urdf, link_torques
from vsacli.robot.models.urdf import urdf_model

ROUNDING = 1e-9
"""Of torques, relative to the largest: angles in text are exact, but frames are turned to them and back, and
almost parallel axes are told apart by 1e-4 rad, which divides the digits of a length."""


def bounded(robot):
    """Without damping, which Pinocchio's `rnea` leaves out, and with limits: else it uses cos and sin."""
    joints = (
        dataclasses.replace(joint, damping=0.0, limits=Limits(position=(-9, 9))) for joint in robot.joints
    )
    return dataclasses.replace(robot, joints=tuple(joints))


@pytest.mark.parametrize("seed", range(3))
def test_pinocchio_reads_a_tree(seed, tmp_path):
    robot = bounded(without_resistance(random_tree(seed, 4 + 3 * seed)))
    path = tmp_path / "robot.urdf"
    path.write_text(urdf_model(robot).text)
    model = pin.buildModelFromUrdf(str(path))
    model.gravity.linear = np.array(ODD_GRAVITY)
    data = model.createData()
    order = [robot.joint_names.index(name) for name in list(model.names)[1:]]
    motion = random_motion(robot, 5, seed=2)
    expected = link_torques(robot, *motion).tau_e
    rounding = 1e-12 * np.abs(expected).max()  # sums of some hundred terms, each good to 1e-16
    for q, dq, ddq, torque in zip(*motion[:3], expected, strict=True):
        states = (state[order] for state in (q, dq, ddq))
        np.testing.assert_allclose(pin.rnea(model, data, *states), torque[order], rtol=0, atol=rounding)
        pin.framesForwardKinematics(model, data, q[order])
        poses = forward_kinematics(robot, q)[len(order) :]
        for tool, pose in zip(robot.tools, poses, strict=True):
            reached = data.oMf[model.getFrameId(tool.name)].homogeneous
            np.testing.assert_allclose(reached, pose, atol=1e-13)  # m; products of up to twelve rotations


@pytest.mark.parametrize(
    "robot",
    [
        shipped_robot("torso_2x3r"),
        shipped_robot("hand_3x2r"),
        without_resistance(random_tree(1, 6)),
        without_resistance(random_tree(4, 8)),
    ],
    ids=lambda robot: robot.name,
)
def test_trees_come_back(robot, tmp_path):
    """Torques and tools by name, since the file is read depth first."""
    path = tmp_path / "robot.urdf"
    path.write_text(urdf_model(robot).text)
    found = import_urdf(path, placeholders=Placeholders("rigid")).robot
    found = dataclasses.replace(found, gravity=robot.gravity)
    order = [robot.joint_names.index(name) for name in found.joint_names]
    assert sorted(order) == list(range(len(robot.joints)))
    motion = random_motion(robot, 10, seed=3)
    in_order = [values[:, order] for values in motion]
    for torques, expected in zip(link_torques(found, *in_order), link_torques(robot, *motion), strict=True):
        rounding = ROUNDING * np.abs(expected).max()
        np.testing.assert_allclose(torques, expected[:, order], rtol=0, atol=rounding)
    poses = tools_by_name(robot, motion[0])
    reached = tools_by_name(found, in_order[0])
    common = set(poses) & set(reached)
    assert common == only_tools_of_tips(robot)
    for name in common:
        np.testing.assert_allclose(reached[name], poses[name], atol=ROUNDING)  # of lengths of about 1 m


def only_tools_of_tips(robot):
    """Tools that `import-urdf` takes without `--tip`: those that are the only one at a tip."""
    carriers = [tool.joint for tool in robot.tools]
    tips = {robot.joint_names[tip] for tip in robot.tips}
    return {tool.name for tool in robot.tools if tool.joint in tips and carriers.count(tool.joint) == 1}


def tools_by_name(robot, q):
    poses = forward_kinematics(robot, q)[:, len(robot.joints) :]
    return {name: poses[:, index] for index, name in enumerate(robot.tool_names)}


def test_links_of_tools_have_names_of_their_own():
    """A tool may be called as the root or a link of a joint is."""
    robot = shipped_robot("torso_2x3r")
    tools = (
        Tool(name="world", joint="left_elbow"),
        Tool(name="waist_link", joint="waist"),
        Tool(name="waist", joint="right_elbow"),
    )
    root = ElementTree.fromstring(urdf_model(dataclasses.replace(robot, tools=tools)).text)
    links = [link.get("name") for link in root.iter("link")]
    assert links[-3:] == ["world.tool", "waist_link.tool", "waist"]
    assert len(set(links)) == len(links)
    joints = [joint.get("name") for joint in root.iter("joint")]
    assert len(set(joints)) == len(joints)


def test_rods_lead_to_the_mounts():
    """The links that carry them draw both; their ends are the frame of the link and the mount."""
    robot = shipped_robot("torso_2x3r")
    root = ElementTree.fromstring(urdf_model(robot).text)
    (waist,) = (link for link in root.iter("link") if link.get("name") == "waist_link")
    rods = waist.findall("visual")[1:]
    for rod, name in zip(rods, ("left_shoulder_lift", "right_shoulder_lift"), strict=True):
        origin = rod.find("origin")
        xyz, (roll, pitch, yaw) = (np.array(origin.get(key).split(), float) for key in ("xyz", "rpy"))
        axis = pin.rpy.rpyToMatrix(roll, pitch, yaw)[:, 2]
        half = axis * float(rod.find("geometry/cylinder").get("length")) / 2
        (seat,) = (
            np.array(joint.find("origin").get("xyz").split(), float)
            for joint in root.iter("joint")
            if joint.get("name") == name
        )
        np.testing.assert_allclose(xyz - half, 0, atol=1e-15)  # lengths of 0.2 m
        np.testing.assert_allclose(xyz + half, seat, atol=1e-15)
