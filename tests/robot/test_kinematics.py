"""Forward kinematics and the Jacobian, against matrices of its own, Pinocchio, torques and differences."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import kinematics as oracle
from oracles import pinocchio
from samples.robots import random_motion, random_robot, vsa_3r
from samples.wrenches import held, random_wrench

from vsacli import InputError, Pose, Robot, forward_kinematics, jacobian, link_torques
from vsacli.base.wrench import WRENCH_FRAMES

ROUNDING = 1e-13
"""Of a few dozen products of numbers of size 1 to 10 (m): some 100 eps, the rest is margin."""

SAMPLES = 20
ROBOTS = [
    *(held(random_robot(types, seed)) for seed, types in enumerate(("R", "P", "RPR", "PRRP", "RRRRRRR"), 1)),
    vsa_3r(),
]
robots = pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
frames = pytest.mark.parametrize("frame", WRENCH_FRAMES)


def positions(robot: Robot, seed: int = 1) -> np.ndarray:
    return random_motion(robot, SAMPLES, seed=seed)[0]


@robots
def test_the_last_pose_is_that_of_the_end_effector_in_the_base_frame(robot: Robot) -> None:
    q = positions(robot)
    expected = [oracle.tool_pose(robot, row).real for row in q]
    np.testing.assert_allclose(forward_kinematics(robot, q)[:, -1], expected, rtol=0, atol=ROUNDING)


@robots
def test_each_pose_is_that_of_a_robot_which_ends_there(robot: Robot) -> None:
    q = positions(robot)
    poses = forward_kinematics(robot, q)
    assert poses.shape == (SAMPLES, len(robot.joints) + 1, 4, 4)
    for index in range(len(robot.joints)):
        shorter = Robot(name="shorter", base=robot.base, joints=robot.joints[: index + 1])
        expected = [oracle.tool_pose(shorter, row[: index + 1]).real for row in q]
        np.testing.assert_allclose(poses[:, index], expected, rtol=0, atol=ROUNDING)


@robots
def test_link_frames_agree_with_pinocchio(robot: Robot) -> None:
    q = positions(robot, seed=2)
    np.testing.assert_allclose(forward_kinematics(robot, q), pinocchio.poses(robot, q), rtol=0, atol=ROUNDING)


@robots
@frames
def test_the_jacobian_agrees_with_pinocchio(robot: Robot, frame: str) -> None:
    q = positions(robot, seed=3)
    expected = pinocchio.jacobians(robot, q, in_base=frame == "base")
    np.testing.assert_allclose(jacobian(robot, q, frame), expected, rtol=0, atol=ROUNDING)


@robots
def test_the_jacobian_is_the_derivative_of_the_pose(robot: Robot) -> None:
    q, step = positions(robot, seed=4), 1e-6
    expected = np.empty((SAMPLES, 6, len(robot.joints)))
    for joint, moved in enumerate(step * np.eye(len(robot.joints))):
        after, before = (forward_kinematics(robot, q + sign * moved)[:, -1] for sign in (1, -1))
        rate = (after - before) / (2 * step)
        spin = rate[:, :3, :3] @ np.swapaxes(forward_kinematics(robot, q)[:, -1, :3, :3], 1, 2)
        expected[:, :3, joint] = rate[:, :3, 3]
        expected[:, 3:, joint] = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    # Central differences: step^2 times third derivatives, and eps / step times lengths of some meters.
    np.testing.assert_allclose(jacobian(robot, q, "base"), expected, rtol=0, atol=1e-8)


@robots
@frames
def test_a_wrench_changes_tau_e_by_minus_the_jacobian_transposed_times_it(robot: Robot, frame: str) -> None:
    q, wrench = positions(robot, seed=5), random_wrench(SAMPLES, frame, seed=5)
    change = link_torques(robot, q, wrench=wrench).tau_e - link_torques(robot, q).tau_e
    expected = -np.einsum("sij,si->sj", jacobian(robot, q, frame), wrench.wrench)
    scale = np.abs(link_torques(robot, q).tau_e).max() + np.abs(expected).max()
    np.testing.assert_allclose(change, expected, rtol=0, atol=ROUNDING * scale)


@robots
@frames
def test_one_configuration_is_a_row_of_many(robot: Robot, frame: str) -> None:
    q = positions(robot)
    np.testing.assert_array_equal(forward_kinematics(robot, q[3]), forward_kinematics(robot, q)[3])
    np.testing.assert_array_equal(jacobian(robot, q[3].tolist(), frame), jacobian(robot, q[3:4], frame)[0])
    assert forward_kinematics(robot, q[:0]).shape == (0, len(robot.joints) + 1, 4, 4)
    assert jacobian(robot, q[:0]).shape == (0, 6, len(robot.joints))


def test_axes_are_those_of_the_end_effector_by_default_as_of_a_wrench() -> None:
    robot = held(random_robot("RPR", seed=1))
    np.testing.assert_array_equal(jacobian(robot, np.ones(3)), jacobian(robot, np.ones(3), "end_effector"))
    assert not np.allclose(jacobian(robot, np.ones(3)), jacobian(robot, np.ones(3), "base"))


def test_the_rest_pose_of_the_paper_arm() -> None:
    straight = forward_kinematics(vsa_3r(), np.zeros(3))
    np.testing.assert_allclose(straight[-1], straight[-2])  # no tool
    assert vsa_3r().tool == Pose()


def test_what_cannot_be_a_position_is_refused() -> None:
    for function in (forward_kinematics, jacobian):
        with pytest.raises(InputError, match=r"q must have the shape \(3\) or \(samples, 3\), not \(2,\)"):
            function(vsa_3r(), [0, 0])
        with pytest.raises(InputError, match="q must be an array"):
            function(vsa_3r(), ["a", "b", "c"])
    with pytest.raises(InputError, match="unknown frame 'tool' of the Jacobian"):
        jacobian(vsa_3r(), [0, 0, 0], "tool")
