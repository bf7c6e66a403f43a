"""Compliance and limits of tools of random trees: branches in another order, and branches alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples.trees import finger, reordered, tree_cases, tree_run

from vsacli import inverse_dynamics

SAME = 1e-11
"""Of the largest entry: rounding of sums in another order, times the condition of K + dg/dq."""


@pytest.mark.cases(5)
@pytest.mark.parametrize("case", tree_cases(50, joints=8))
def test_tools_do_not_depend_on_other_branches_nor_on_their_order(case):
    seed, joints = case
    robot, motion = tree_run(seed, joints)
    limited = (replace(tool, min_stiffness=500.0) for tool in robot.tools)
    robot = replace(robot, tools=tuple(limited))
    whole = of_tools(robot, motion)
    others = [reordered(robot, seed)]
    others += [finger(robot, root) for root in {robot.paths[tool][0] for tool in robot.tool_joints}]
    for other in others:
        for name, (compliance, flags, texts) in of_tools(other, motion).items():
            expected, expected_flags, expected_texts = whole[name]
            size = np.nanmax(np.abs(expected), initial=0.0)
            np.testing.assert_allclose(compliance, expected, rtol=0, atol=SAME * size)
            np.testing.assert_array_equal(flags, expected_flags)
            assert texts == expected_texts


def of_tools(robot, motion):
    """Compliance, flags and sentences of each tool by name."""
    result = inverse_dynamics(robot, motion.trajectory(robot), tip_compliance=True)
    return {
        tool.name: (
            result.tip_compliance[:, index],
            result.tool_flags[:, index],
            {kind: finding.text for kind, finding in tool.worst.items()},
        )
        for index, tool in enumerate(result.report.tools)
    }
