"""Frames, tools and Jacobians of random trees against Pinocchio; torques of their weight."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from oracles import pinocchio
from samples.marks import slow_but
from samples.robots import random_motion
from samples.trees import SMALL, random_tree

from vsacli import InputError, forward_kinematics, jacobian
from vsacli.base.wrench import WRENCH_FRAMES
from vsacli.files.info.robot_info import gravity_torques

ROUNDING = 1e-12
"""m: a chain of 20 products of numbers of size 1 to 20."""

SAMPLES = 10

pytestmark = pytest.mark.cases(4)

trees = pytest.mark.parametrize("seed", slow_but(SMALL, range(50)))


@trees
def test_links_and_tools_are_where_pinocchio_has_them(seed: int) -> None:
    robot = random_tree(seed)
    q = random_motion(robot, SAMPLES, seed)[0]
    found = forward_kinematics(robot, q)
    assert found.shape == (SAMPLES, len(robot.joints) + len(robot.tools), 4, 4)
    np.testing.assert_allclose(found, pinocchio.poses(robot, q), rtol=0, atol=ROUNDING)


@trees
@pytest.mark.parametrize("frame", WRENCH_FRAMES)
def test_jacobians_of_each_tool_are_those_of_pinocchio(seed: int, frame: str) -> None:
    robot = random_tree(seed)
    q = random_motion(robot, SAMPLES, seed)[0]
    for index, tool in enumerate(robot.tools):
        found = jacobian(robot, q, frame, tool=tool.name)
        expected = pinocchio.jacobians(robot, q, in_base=frame == "base", tool=index)
        np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING)
        still = [
            joint for joint in range(len(robot.joints)) if joint not in robot.paths[robot.tool_joints[index]]
        ]
        assert not found[..., still].any()


@trees
def test_torques_of_the_weight_are_those_of_pinocchio(seed: int) -> None:
    robot = random_tree(seed)
    q = random_motion(robot, SAMPLES, seed)[0]
    model = pinocchio.build(robot)
    data = model.createData()
    expected = np.array([pin.computeGeneralizedGravity(model, data, row).copy() for row in q])
    # N m (N): the torques are of the size 100, and sums of some hundred terms.
    np.testing.assert_allclose(gravity_torques(robot, q), expected, rtol=0, atol=1e-11)


def test_a_tool_has_a_name_that_is_said_if_there_are_several() -> None:
    robot = next(tree for tree in map(random_tree, range(20)) if len(tree.tools) == 3)
    q = np.zeros(len(robot.joints))
    with pytest.raises(InputError) as unsaid:
        jacobian(robot, q)
    assert str(unsaid.value) == f"{robot.name} has the tools tool_0, tool_1, tool_2; say which one"
    with pytest.raises(InputError) as unknown:
        jacobian(robot, q, tool="tool_9")
    assert str(unknown.value) == f"{robot.name} has no tool 'tool_9'; did you mean 'tool_2'?"
    with pytest.raises(
        TypeError, match="tool must be a str, not an int; tools are given by name, such as 'tool_0'"
    ):
        jacobian(robot, q, tool=0)  # type: ignore[arg-type]
