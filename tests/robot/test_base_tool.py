"""The poses `base` and `tool` of a robot: gravity and wrench in the frames they are given in."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from oracles import pinocchio
from oracles.kinematics import tool_pose, transform
from samples.robots import ODD_GRAVITY, random_motion, random_robot, with_gravity
from samples.wrenches import random_wrench

from vsacli import InputError, Pose, Robot, Wrench, link_torques, load_robot
from vsacli.compute.vector import Vector
from vsacli.robot.kinematics import base_gravity

ROUNDING = 1e-12
"""Of the peak: a rotation more is some 10 eps; the rest is margin. A wrong axis or order shows at 1e-1."""

TILTED = Pose(xyz=(0.3, -0.2, 0.7), rpy=(0.4, -1.1, 2.3))
HELD = Pose(xyz=(-0.1, 0.25, 0.15), rpy=(-0.7, 0.9, 1.9))
ROBOT = random_robot("RPRR", seed=4)
MOTION = random_motion(ROBOT, 40, seed=4)


def placed(robot: Robot, *, base: Pose = ROBOT.base, tool: Pose = ROBOT.tool) -> Robot:
    return dataclasses.replace(robot, base=base, tool=tool)


def assert_same(actual: object, expected: object) -> None:
    actual, expected = np.array(actual), np.array(expected)
    peak = np.abs(expected).max(axis=1, keepdims=True)
    assert (np.abs(actual - expected) <= ROUNDING * peak).all()


def rotation(pose: Pose) -> np.ndarray:
    return transform(pose).real[:3, :3]


def test_gravity_is_given_in_the_base_frame() -> None:
    tilted = placed(ROBOT, base=TILTED)
    moved = with_gravity(ROBOT, rotation(TILTED).T @ ODD_GRAVITY)
    assert_same(link_torques(tilted, *MOTION), link_torques(moved, *MOTION))


def test_torques_on_a_tilted_base_agree_with_pinocchio() -> None:
    tilted = placed(ROBOT, base=TILTED)
    tau_e, *_ = link_torques(tilted, *MOTION)
    assert_same([tau_e], [pinocchio.torques(tilted, *MOTION[:3])])


def test_turning_base_and_gravity_together_changes_nothing() -> None:
    turned = with_gravity(placed(ROBOT, base=TILTED), rotation(TILTED) @ ODD_GRAVITY)
    assert_same(link_torques(turned, *MOTION), link_torques(ROBOT, *MOTION))


def test_turning_base_gravity_and_a_wrench_in_base_axes_together_changes_nothing() -> None:
    wrench = random_wrench(40, "base", seed=1)
    turn = np.kron(np.eye(2), rotation(TILTED))
    turned = with_gravity(placed(ROBOT, base=TILTED), rotation(TILTED) @ ODD_GRAVITY)
    with_wrench = wrench.mapped(lambda rows, _: rows @ turn.T)
    assert_same(link_torques(turned, *MOTION, with_wrench), link_torques(ROBOT, *MOTION, wrench))


def test_the_place_of_the_base_changes_no_bit() -> None:
    elsewhere = placed(ROBOT, base=Pose(xyz=(3, -2, 1)))
    np.testing.assert_array_equal(link_torques(elsewhere, *MOTION), link_torques(ROBOT, *MOTION))


@pytest.mark.parametrize("frame", ["end_effector", "base"])
def test_poses_of_identity_change_no_bit(frame: str) -> None:
    full_turns = Pose(rpy=(2 * math.pi, -2 * math.pi, 4 * math.pi))
    same = placed(ROBOT, base=full_turns, tool=full_turns)
    assert base_gravity(ROBOT) == base_gravity(same) == Vector(*ODD_GRAVITY)
    wrench = random_wrench(40, frame, seed=2)
    np.testing.assert_array_equal(link_torques(same, *MOTION, wrench), link_torques(ROBOT, *MOTION, wrench))


def test_a_tool_without_a_wrench_changes_no_bit() -> None:
    np.testing.assert_array_equal(
        link_torques(placed(ROBOT, tool=HELD), *MOTION), link_torques(ROBOT, *MOTION)
    )


def test_a_wrench_at_the_tool_is_that_wrench_moved_to_the_last_link() -> None:
    at_tool = random_wrench(40, "end_effector", seed=3)

    def moved(rows: np.ndarray, _: int) -> np.ndarray:
        force, moment = rows[:, :3] @ rotation(HELD).T, rows[:, 3:] @ rotation(HELD).T
        return np.hstack([force, moment + np.cross(HELD.xyz, force)])

    held = link_torques(placed(ROBOT, tool=HELD), *MOTION, at_tool)
    assert_same(held, link_torques(ROBOT, *MOTION, at_tool.mapped(moved)))


def test_a_constant_force_in_base_axes_at_the_tool_has_a_moment_that_turns_with_the_link() -> None:
    still = np.zeros((40, 6))
    force = np.array([3.0, -20.0, 11.0])
    push = Wrench(np.tile([*force, 0, 0, 0], (40, 1)), still, still, frame="base")
    held = placed(ROBOT, tool=Pose(xyz=HELD.xyz))
    arms = [
        tool_pose(held, q).real[:3, 3] - tool_pose(ROBOT, q).real[:3, 3] for q in MOTION[0]
    ]  # from the origin of frame N, base axes
    with_moment = dataclasses.replace(push, wrench=np.hstack([push.wrench[:, :3], np.cross(arms, force)]))
    tau_e, *_ = link_torques(held, *MOTION, push)
    assert_same([tau_e], [link_torques(ROBOT, *MOTION, with_moment)[0]])


@pytest.mark.parametrize(
    ("rpy", "expected"),
    [
        ((math.pi / 2, 0, 0), (0, -9.81, 0)),
        ((0, -math.pi / 2, 0), (-9.81, 0, 0)),
        ((math.pi, 0, 1.2), (0, 0, 9.81)),
        ((0, 0, -2.5), (0, 0, -9.81)),
    ],
    ids=str,
)
def test_right_angles_leave_exact_zeros(rpy: tuple[float, float, float], expected: tuple[float, ...]) -> None:
    robot = with_gravity(placed(ROBOT, base=Pose(rpy=rpy)), (0, 0, -9.81))
    gravity = base_gravity(robot)
    assert gravity == Vector(*expected)
    assert [type(component) is int for component in gravity] == [component == 0 for component in expected]


def test_roll_pitch_yaw_is_that_of_urdf() -> None:
    turned = placed(with_gravity(ROBOT, (1, 2, 3)), base=TILTED)
    expected = pinocchio.pin.rpy.rpyToMatrix(*TILTED.rpy).T @ [1, 2, 3]
    assert tuple(base_gravity(turned)) == pytest.approx(tuple(expected), rel=1e-14)  # some 10 eps


HEAD = "format: vsacli-robot/1\nname: rig\n"
JOINTS = """joints:
  - name: swing
    type: revolute
    dh: {a: 0.2, alpha: 0}
    link: {mass: 2, com: [0, 0, 0], inertia: {xx: 1, yy: 1, zz: 1}}
    actuator: {type: antagonistic, motor: {inertia: 1}, spring: {type: cubic, k: 400, k_c: 2000}}
"""


def test_the_poses_in_a_robot_file(tmp_path) -> None:
    path = tmp_path / "rig.yaml"
    poses = "base: {xyz: [0, 0, 1/2], rpy: [90 deg, 0, -pi]}\ntool: {xyz: [0.1, 0, 0]}\n"
    path.write_text(HEAD + poses + JOINTS)
    robot = load_robot(path)
    assert robot.base == Pose(xyz=(0, 0, 0.5), rpy=(math.pi / 2, 0, -math.pi))
    assert robot.tool == Pose(xyz=(0.1, 0, 0), rpy=(0, 0, 0))


def test_without_them_they_are_the_identity(tmp_path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(HEAD + JOINTS)
    assert (load_robot(path).base, load_robot(path).tool) == (Pose(), Pose())


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("base: {rpy: [1, 2]}", "3: rpy: expected 3 numbers in rad, found 2"),
        ("tool: {xyz: [1, 2, 3, 4]}", "3: xyz: expected 3 numbers in m, found 4"),
        ("tool: {xyz: [90 deg, 0, 0]}", "3: xyz: '90 deg' is an angle; expected a number in m"),
        ("base: {rpy: [1, 2, .inf]}", "3: rpy: expected a number in rad, found '.inf'"),
        ("base: {rpi: [1, 2, 3]}", "3: unknown key 'rpi'; did you mean 'rpy'?"),
        ("tool: 3", "3: tool: expected a mapping, found '3'"),
    ],
)
def test_a_problem_of_a_pose_is_named_with_its_line(tmp_path, monkeypatch, line: str, problem: str) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.yaml").write_text(f"{HEAD}{line}\n{JOINTS}")
    with pytest.raises(InputError) as refusal:
        load_robot("rig.yaml")
    assert str(refusal.value).startswith(f"rig.yaml:{problem}")
