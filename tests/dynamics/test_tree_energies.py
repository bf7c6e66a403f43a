"""Energy of the links of random trees, and the powers that change it, against Lagrange's equations."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.lagrange import chain_of
from samples.robots import MotionArrays
from samples.trees import tree_cases, tree_run

from vsacli import motor_torques
from vsacli.base.variables import Block
from vsacli.dynamics.balances import link_energy, link_powers

ROUNDING = 1e-12
"""Of the largest energy or power: sums of some thousand terms."""

pytestmark = pytest.mark.cases(5)

trees = pytest.mark.parametrize("case", tree_cases(50))


def motion_of(block: Block) -> MotionArrays:
    return block.q, block.dq, block.ddq, block.d3q, block.d4q


@trees
def test_energy_is_that_of_lagranges_equations_but_for_a_constant(case: tuple[int, int | None]) -> None:
    robot, motion = tree_run(*case)
    block = motor_torques(robot, motion.trajectory(robot).block(0, 41))
    chain = chain_of(robot, motion_of(block))
    expected = chain.kinetic_energy(0) + chain.potential_energy(0)
    found = link_energy(robot, block)
    np.testing.assert_allclose(
        found - found[0], expected - expected[0], rtol=0, atol=ROUNDING * np.abs(expected).max()
    )


@trees
def test_powers_of_joints_losses_and_wrenches_change_the_energy(case: tuple[int, int | None]) -> None:
    robot, motion = tree_run(*case)
    trajectory = motion.trajectory(robot)
    block = motor_torques(robot, trajectory.block(0, 41))
    chain = chain_of(robot, motion_of(block))
    assert trajectory.wrench is not None
    powers = link_powers(robot, block, trajectory.wrench.frame)
    rate = chain.kinetic_energy(1) + chain.potential_energy(1)
    np.testing.assert_allclose(sum(powers), rate, rtol=0, atol=ROUNDING * np.abs(powers).max())
