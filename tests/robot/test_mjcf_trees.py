"""Exported trees in MuJoCo: its inverse dynamics, key frames, tools and names."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from samples.moves import move
from samples.mujoco_models import compiled, coordinates, forces_of_tools, inverse_error, mujoco
from samples.robots import random_actuator, random_motion, random_robot
from samples.shipped import shipped_robot
from samples.trees import random_tree, random_wrenches, reordered, without_resistance

from vsacli import Elastic, Motor, Rigid, Trajectory, forward_kinematics, inverse_dynamics, link_torques
from vsacli.robot.models.mjcf import mjcf_model
from vsacli.robot.models.mjcf_drives import Start

ROUNDING = 1e-12
"""Of inverse dynamics, relative to the largest torque: sums of some hundred terms, each good to 1e-16, and
bodies of 1e-14 kg where a motor has none."""

NAN = (np.nan, np.nan)
SIZES = {0: 5, 1: 6, 3: 8, 4: 12, 7: 20}
"""Numbers of joints of five random trees, by seed."""


def with_cubic_pairs(robot):
    """The robot with two motors behind cubic springs at each joint, without friction and dampers."""
    rng = np.random.default_rng(len(robot.joints))
    bare = without_resistance(robot)
    joints = (dataclasses.replace(joint, actuator=random_actuator(rng)) for joint in bare.joints)
    return dataclasses.replace(bare, joints=tuple(joints))


@pytest.mark.parametrize("seed", SIZES)
def test_link_torques_of_random_trees_under_wrenches(seed):
    """Motors stand where they do not load their cubic springs, so that MuJoCo finds tau_e at the joints."""
    robot = with_cubic_pairs(random_tree(seed, SIZES[seed]))
    assert len(robot.tips) > 1
    assert "prismatic" in robot.joint_types
    motion, wrenches = random_motion(robot, 4, seed), random_wrenches(robot, 4, seed)
    expected = link_torques(robot, *motion, wrench=wrenches).tau_e
    torques = np.empty_like(expected)
    with compiled(robot) as (model, data):
        places = [model.joint(name).dofadr[0] for name in robot.joint_names]
        for sample, (q, dq, ddq) in enumerate(zip(*motion[:3], strict=True)):
            data.qvel[places], data.qacc[places] = dq, ddq
            for joint, position in zip(robot.joints, q, strict=True):
                for name in (joint.name, f"{joint.name}.motor_1", f"{joint.name}.motor_2"):
                    data.joint(name).qpos[0] = position
            mujoco.mj_inverse(model, data)
            loads = forces_of_tools(robot, wrenches.frame, wrenches.wrench[sample], model, data)
            torques[sample] = (data.qfrc_inverse - loads)[places]
    np.testing.assert_allclose(torques, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())


def rest_to_rest(stiffness: list[tuple[float, float]], duration: float, rate: float) -> Trajectory:
    """A motion of joints by half a radian or meter in turn; stiffness from one to another, NaN if none."""
    start = np.linspace(0.2, -0.3, len(stiffness)).tolist()
    end = [position + (-1) ** index / 2 for index, position in enumerate(start)]
    of_stiffness = tuple(zip(*stiffness, strict=True))
    return move(duration, rate, (start, end), degrees=(11, 7), stiffness=of_stiffness)


def run_of_all_drives():
    """A tree with every way in which a model drives a joint, and a run; a MACCEPA turns on a mount."""
    maccepa = shipped_robot("maccepa_1r").joints[0].actuator
    strong = dataclasses.replace(maccepa.mechanism, k=1000 * maccepa.mechanism.k)
    motor = Motor(inertia=1.5, damping=0.1)
    robot = with_cubic_pairs(random_tree(9, 6))
    actuators = (
        Rigid(motor=motor),
        Elastic(motor=motor, stiffness=5000),
        robot.joints[2].actuator,
        dataclasses.replace(maccepa, mechanism=strong),
        robot.joints[4].actuator,
        shipped_robot("shifted_cams_1r").joints[0].actuator,
    )
    joints = [
        dataclasses.replace(joint, actuator=actuator)
        for joint, actuator in zip(robot.joints, actuators, strict=True)
    ]
    assert joints[3].mount is not None
    robot = dataclasses.replace(robot, joints=tuple(joints))
    stiffness = [NAN, NAN, (1500, 2500), (200, 300), (1500, 2500), (400, 500)]
    return robot, inverse_dynamics(robot, rest_to_rest(stiffness, 1.0, 20))


@pytest.mark.slow
def test_motor_torques_of_a_tree_with_all_kinds_of_drives():
    robot, result = run_of_all_drives()
    assert not result.flags.any(), result.report
    assert inverse_error(robot, result) < ROUNDING


@pytest.mark.slow
def test_a_key_frame_has_the_start_of_a_run():
    """MuJoCo lists coordinates depth first, the file by its own order."""
    robot, result = run_of_all_drives()
    with compiled(robot, Start(*(getattr(result, each)[0] for each in Start._fields))) as (model, data):
        in_model = [model.joint(index).name for index in range(model.njnt)]
        assert [name for name in in_model if name in robot.joint_names] != list(robot.joint_names)
        mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
        rows = coordinates(robot, model, result)
        np.testing.assert_array_equal(data.qpos, rows.positions[0])
        np.testing.assert_array_equal(data.qvel, rows.velocities[0])


def test_every_tool_is_where_the_forward_kinematics_say():
    """A site may be called as a joint is."""
    robot = with_cubic_pairs(random_tree(4, 8))
    renamed = dataclasses.replace(robot.tools[0], name=robot.joint_names[0])
    robot = dataclasses.replace(robot, tools=(renamed, *robot.tools[1:]))
    q = np.random.default_rng(5).uniform(-1, 1, len(robot.joints))
    poses = forward_kinematics(robot, q)
    with compiled(robot) as (model, data):
        for name, position in zip(robot.joint_names, q, strict=True):
            data.joint(name).qpos[0] = position
        mujoco.mj_kinematics(model, data)
        for tool, pose in zip(robot.tools, poses[len(q) :], strict=True):
            site = data.site(tool.name)
            np.testing.assert_allclose(site.xmat.reshape(3, 3), pose[:3, :3], atol=1e-14)  # of rotations
            np.testing.assert_allclose(site.xpos, pose[:3, 3], atol=1e-14)  # lengths of about 1 m


def forces_by_name(robot, q, dq, ddq):
    """MuJoCo's forces on all coordinates, by name, at positions, velocities and accelerations of joints."""
    with compiled(robot) as (model, data):
        for name, *state in zip(robot.joint_names, q, dq, ddq, strict=True):
            coordinate = data.joint(name)
            coordinate.qpos[0], coordinate.qvel[0], coordinate.qacc[0] = state
        mujoco.mj_inverse(model, data)
        return {model.joint(index).name: data.qfrc_inverse[index] for index in range(model.nv)}


def test_branches_in_another_order_are_the_same_model():
    robot = with_cubic_pairs(random_tree(4, 8))
    other = reordered(robot, seed=1)
    order = [robot.joint_names.index(name) for name in other.joint_names]
    state = np.random.default_rng(8).uniform(-1, 1, (3, len(order)))
    expected = forces_by_name(robot, *state)
    forces = forces_by_name(other, *state[:, order])
    largest = max(map(abs, expected.values()))
    assert forces == pytest.approx(expected, rel=0, abs=ROUNDING * largest)


def test_names_and_shapes_of_bodies():
    """A rod leads to each mount; the site of a robot without `tools` is called tool."""
    robot = shipped_robot("torso_2x3r")
    root = ElementTree.fromstring(mjcf_model(robot).text)
    (waist,) = (body for body in root.iter("body") if body.get("name") == "waist.link")
    mounts = [body.get("name") for body in waist.findall("body")]
    assert mounts == ["left_shoulder_lift.mount", "right_shoulder_lift.mount"]
    assert len(waist.findall("geom")) == 1 + len(mounts)
    assert [site.get("name") for site in root.iter("site")] == ["left_hand", "right_hand"]
    without = mjcf_model(dataclasses.replace(robot, tools=()))
    assert not list(ElementTree.fromstring(without.text).iter("site"))
    (tool,) = ElementTree.fromstring(mjcf_model(random_robot("RR", 1)).text).iter("site")
    assert tool.get("name") == "tool"
