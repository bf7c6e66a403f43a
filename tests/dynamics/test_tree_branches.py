"""Branches of a tree in another order give the same, and a finger on the base gives what it gives alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from samples.trees import finger, reordered, tree_cases, tree_run

from vsacli import Result, inverse_dynamics
from vsacli.base.arrays import AnyArray
from vsacli.base.variables import VARIABLES

ROUNDING = 1e-12
"""Of the peak of each joint: forces of several branches are added in another order; 1e-14 is seen."""

trees = pytest.mark.parametrize("case", tree_cases(50))


def of_joints(result: Result, places: Sequence[int]) -> Iterator[tuple[str, AnyArray]]:
    """Variables of some joints, by index, with their names: (samples, joints[, motors])."""
    for name, variable in VARIABLES.items():
        array = getattr(result, name, None)
        if array is not None and variable.dims[:1] == ("joint",):
            yield name, array[:, places]


def assert_equal(one: Result, other: Result, places: Sequence[int]) -> None:
    """The joints of one, in order, are those of the other at some places."""
    compared = 0
    for (name, found), (_, expected) in zip(
        of_joints(one, range(one.q.shape[1])), of_joints(other, places), strict=True
    ):
        compared += 1
        finite = np.isfinite(expected) if found.dtype.kind == "f" else np.zeros_like(expected, dtype=bool)
        np.testing.assert_array_equal(found[~finite], expected[~finite], err_msg=name)
        numbers, references = (np.where(finite, array, 0) for array in (found, expected))
        peak = np.abs(references).max(axis=0)
        assert (np.abs(numbers - references) <= ROUNDING * peak).all(), name
    assert compared > 15


@trees
def test_the_order_of_the_branches_is_that_of_the_results_alone(case: tuple[int, int | None]) -> None:
    robot, motion = tree_run(*case)
    other = reordered(robot, case[0])
    assert (robot.joint_names == other.joint_names) == (len(robot.tips) == 1)
    places = [robot.joint_names.index(name) for name in other.joint_names]
    one, two = (inverse_dynamics(each, motion.trajectory(each)) for each in (other, robot))
    assert_equal(one, two, places)
    assert one.report.verdict == two.report.verdict
    assert one.report.self_check.passed
    assert two.report.self_check.passed


@trees
def test_a_finger_on_the_base_gives_what_it_gives_alone(case: tuple[int, int | None]) -> None:
    robot, motion = tree_run(*case)
    whole = inverse_dynamics(robot, motion.trajectory(robot))
    for root in (index for index, parent in enumerate(robot.parents) if parent < 0):
        alone = finger(robot, root)
        places = [robot.joint_names.index(name) for name in alone.joint_names]
        assert_equal(inverse_dynamics(alone, motion.trajectory(alone)), whole, places)
