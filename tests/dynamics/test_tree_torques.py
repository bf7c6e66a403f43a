"""Torques of random trees and their derivatives, against Pinocchio and Lagrange's equations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from oracles import pinocchio
from oracles.contact import contact_torques, contacts_of
from oracles.lagrange import chain_of
from oracles.modified_dh import in_modified_rows
from samples.marks import slow_but
from samples.robots import MotionArrays, random_motion
from samples.trees import SMALL, random_tree, random_wrenches, read_tree, without_resistance

from vsacli import InputError, Robot, Wrench, forward_kinematics, link_torques
from vsacli.base.wrench import WrenchFrame, frames_by_tool

ROUNDING = 1e-12
"""Of each joint's peak: 4e-15 is seen, rounding of some thousand operations; a wrong term shows at 1e-3."""

EQUAL = 1e-13
"""Of the peak, between two descriptions of one tree, whose numbers are rounded in different ways."""

SAMPLES = 10

pytestmark = pytest.mark.cases(5)

trees = pytest.mark.parametrize("seed", slow_but((1, *SMALL), range(100)))
some_trees = pytest.mark.parametrize("seed", slow_but(SMALL, range(50)))


def assert_same(actual: np.ndarray, expected: np.ndarray, rounding: float = ROUNDING) -> None:
    """Equal to rounding of each joint's peak over the samples."""
    assert actual.shape == expected.shape
    peak, gap = np.abs(expected).max(axis=0), np.abs(actual - expected).max(axis=0)
    assert (gap <= rounding * peak).all(), f"gaps {gap} at peaks {peak}"


def lagrange_torques(
    tree: Robot, motion: MotionArrays, wrench: Wrench, order: int, *, modified: bool
) -> np.ndarray:
    chain = chain_of(tree, motion, modified=modified)
    total = np.column_stack(chain.torques(order))
    by_order = (wrench.wrench, wrench.dwrench, wrench.ddwrench)
    for contact in contacts_of(tree, by_order, frames_by_tool(wrench.frame)):
        of_joints = contact_torques(chain, contact, order)
        total += np.column_stack([np.broadcast_to(torque, len(total)) for torque in of_joints])
    return total


@trees
@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_torques_and_derivatives_under_wrenches(seed: int, convention: str, tmp_path: Path) -> None:
    written = without_resistance(random_tree(seed))
    robot = written if convention == "standard" else read_tree(written, tmp_path, convention)
    motion, wrench = random_motion(written, SAMPLES, seed), random_wrenches(written, SAMPLES, seed)
    found = link_torques(robot, *motion, wrench)
    modified = convention == "modified"
    of_pinocchio = pinocchio.torques_under_wrench(
        written, motion[:3], wrench.wrench, frames_by_tool(wrench.frame), modified=modified
    )
    assert_same(found.tau_e, of_pinocchio)
    for order, array in enumerate(found):
        assert_same(array, lagrange_torques(written, motion, wrench, order, modified=modified))


@some_trees
def test_a_tree_written_in_both_conventions_is_one_tree(seed: int, tmp_path: Path) -> None:
    robot = random_tree(seed)
    same = read_tree(in_modified_rows(robot), tmp_path, "modified")
    motion, wrench = random_motion(robot, SAMPLES, seed), random_wrenches(robot, SAMPLES, seed)
    for array, expected in zip(
        link_torques(same, *motion, wrench), link_torques(robot, *motion, wrench), strict=True
    ):
        assert_same(array, expected, EQUAL)
    tools = slice(len(robot.joints), None)
    poses = (forward_kinematics(each, motion[0])[:, tools] for each in (robot, same))
    np.testing.assert_allclose(*poses, rtol=0, atol=EQUAL * 10)  # m: trees are some meters long


@some_trees
def test_a_file_of_a_tree_is_the_tree(seed: int, tmp_path: Path) -> None:
    robot = random_tree(seed)
    assert read_tree(robot, tmp_path) == robot


def test_a_tree_with_one_tip_without_mounts_is_the_chain_that_it_is() -> None:
    robot = random_tree(3, joints=6)
    names = robot.joint_names
    chain, tree = (
        Robot(
            name="chain",
            gravity=robot.gravity,
            joints=tuple(
                type(joint)(**{**vars(joint), "parent": parent, "mount": None})
                for joint, parent in zip(robot.joints, parents, strict=True)
            ),
        )
        for parents in ([None] * 6, [None, *names[:-1]])
    )
    motion, wrench = random_motion(chain, SAMPLES, 1), Wrench.constant(np.ones((SAMPLES, 6)))
    for array, expected in zip(
        link_torques(tree, *motion, wrench), link_torques(chain, *motion, wrench), strict=True
    ):
        np.testing.assert_array_equal(array, expected)


@pytest.mark.parametrize(
    ("components", "frame", "message"),
    [
        (
            6,
            "base",
            "the wrench is for 1 tool, the robot has 2: tool_0, tool_1; for several tools give a tuple as "
            "frame, None for a tool on which nothing acts",
        ),
        (6, ("base", None), f"wrench must have the shape ({SAMPLES}, 12), not ({SAMPLES}, 6)"),
    ],
)
def test_a_wrench_for_other_tools_is_refused(components: int, frame: WrenchFrame, message: str) -> None:
    robot = random_tree(0, joints=4)
    wrench = Wrench.constant(np.ones((SAMPLES, components)), frame=frame)
    with pytest.raises(InputError) as refusal:
        link_torques(robot, *random_motion(robot, SAMPLES, 1), wrench)
    assert str(refusal.value) == message


def test_a_tool_on_which_nothing_acts_changes_nothing() -> None:
    robot = random_tree(0, joints=4)
    motion, wrench = random_motion(robot, SAMPLES, 1), random_wrenches(robot, SAMPLES, 1)
    both = Wrench(wrench.wrench, wrench.dwrench, wrench.ddwrench, frame=("base", "end_effector"))
    first = Wrench(wrench.wrench, wrench.dwrench, wrench.ddwrench, frame=("base", None))
    none_on_second = both.mapped(lambda rows, _: rows * np.repeat([1, 0], 6))
    for array, expected in zip(
        link_torques(robot, *motion, first), link_torques(robot, *motion, none_on_second), strict=True
    ):
        assert_same(array, expected)
