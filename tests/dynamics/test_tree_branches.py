"""Branches of a tree in another order give the same, and a finger on the base gives what it gives alone."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pytest
from samples.trees import finger, reordered, tree_cases, tree_run

from vsacli import Result, inverse_dynamics, motor_torques
from vsacli.base.variables import VARIABLES

ROUNDING = 1e-12
"""Of the peak of each joint: forces of several branches are added in another order; 1e-14 is seen."""

pytestmark = pytest.mark.cases(5)

trees = pytest.mark.parametrize("case", tree_cases(50))


def of_joints(result: Result, places: Sequence[int]) -> dict[str, np.ndarray]:
    """Variables of some joints, by index, (samples, joints[, motors])."""
    arrays = {name: getattr(result, name, None) for name in VARIABLES if "joint" in VARIABLES[name].dims}
    return {name: array[:, places] for name, array in arrays.items() if array is not None}


def assert_equal(one: Result, other: Result, places: Sequence[int]) -> None:
    """The joints of one, in order, are those of the other at some places; both have the variables of one."""
    references = of_joints(other, places)
    variables = of_joints(one, range(one.q.shape[1]))
    assert len(variables) > 15
    for name, found in variables.items():
        expected = references[name]
        finite = np.isfinite(expected) if found.dtype.kind == "f" else np.zeros_like(expected, dtype=bool)
        np.testing.assert_array_equal(found[~finite], expected[~finite], err_msg=name)
        gap = np.subtract(found, expected, out=np.zeros(found.shape), where=finite)
        peak = np.max(np.abs(expected), axis=0, initial=0, where=finite)
        assert (np.abs(gap) <= ROUNDING * peak).all(), name


def warned_paths(warnings: Sequence[str]) -> list[str]:
    """Paths in all warnings, of which one names the values in the same unit in the order of the file."""
    return sorted(re.findall(r"joints\.[\w.]+", " ".join(warnings)))


@trees
def test_the_order_of_the_branches_is_that_of_the_results_alone(case: tuple[int, int | None]) -> None:
    robot, motion = tree_run(*case)
    other = reordered(robot, case[0])
    assert (robot.joint_names == other.joint_names) == (len(robot.tips) == 1)
    places = [robot.joint_names.index(name) for name in other.joint_names]
    one, two = (inverse_dynamics(each, motion.trajectory(each)) for each in (other, robot))
    assert_equal(one, two, places)
    assert of_joints(one, places).keys() == of_joints(two, places).keys()
    assert one.report.verdict == two.report.verdict
    assert one.report.self_check.passed
    assert two.report.self_check.passed
    assert warned_paths(one.report.warnings) == warned_paths(two.report.warnings)
    assert warned_paths(other.warnings) == warned_paths(robot.warnings)


@trees
def test_a_finger_on_the_base_gives_what_it_gives_alone(case: tuple[int, int | None]) -> None:
    robot, motion = tree_run(*case)
    whole = inverse_dynamics(robot, motion.trajectory(robot))
    for root in (index for index, parent in enumerate(robot.parents) if parent < 0):
        alone = finger(robot, root)
        places = [robot.joint_names.index(name) for name in alone.joint_names]
        assert_equal(inverse_dynamics(alone, motion.trajectory(alone)), whole, places)


@trees
def test_single_calls_give_what_a_run_gives(case: tuple[int, int | None]) -> None:
    robot, motion = tree_run(*case)
    trajectory = motion.trajectory(robot)
    result = inverse_dynamics(robot, trajectory)
    for sample in (0, 17, 40):
        once = motor_torques(robot, trajectory.at(result.time[sample]))
        np.testing.assert_array_equal(once.flags, result.flags[sample])
        peak = np.max(np.abs(result.tau_motor), axis=0, initial=0, where=np.isfinite(result.tau_motor))
        np.testing.assert_array_equal(np.isnan(once.tau_motor), np.isnan(result.tau_motor[sample]))
        gap = np.nan_to_num(once.tau_motor - result.tau_motor[sample])
        assert (np.abs(gap) <= ROUNDING * peak).all()
