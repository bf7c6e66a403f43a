"""Regressor of random trees, and derivatives of their torques by numbers of links, mounts and tools."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from samples.robots import random_motion
from samples.trees import random_tree, random_wrenches, tree_cases, without_resistance

from vsacli import Motion, Robot, link_torques
from vsacli.robot.parameters import Parameter, parameters
from vsacli.studies.identification.regressor import all_parameters, regressor
from vsacli.studies.sensitivities.slopes import torque_slopes

ROUNDING = 1e-12
"""Of the peak of each joint; sums of some thousand terms."""

WEIGHTS = {-3: -1 / 60, -2: 3 / 20, -1: -3 / 4, 1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
"""Central differences of sixth order."""

SAMPLES = 6

SPEED = 0.2
"""Of the motions, against random ones, of which each derivative is ten times the one before."""

pytestmark = pytest.mark.cases(5)

trees = pytest.mark.parametrize("case", tree_cases(50, joints=8))


@trees
def test_torques_are_the_regressor_times_the_parameters(case: tuple[int, int | None]) -> None:
    robot = without_resistance(random_tree(*case)).replace("joints.*.damping", 0)
    q, dq, ddq, _, _ = random_motion(robot, SAMPLES, case[0])
    found = regressor(robot, q, dq, ddq)
    torques = np.einsum("jps,p->sj", found, all_parameters(robot))
    expected = link_torques(robot, q, dq, ddq).tau_e
    assert (np.abs(torques - expected) <= ROUNDING * np.abs(expected).max(axis=0)).all()
    of_links = found.reshape(len(robot.joints), len(robot.joints), 10, SAMPLES)
    for joint in range(len(robot.joints)):
        carried = [link for link, path in enumerate(robot.paths) if joint in path]
        assert not np.delete(of_links[joint], carried, axis=0).any()
        assert all(of_links[joint, link].any() for link in carried)


@trees
def test_slopes_of_torques_by_numbers_of_links_mounts_and_tools(case: tuple[int, int | None]) -> None:
    robot = without_resistance(random_tree(*case))
    fast = random_motion(robot, SAMPLES, case[0])
    q, dq, ddq, d3q, d4q = (SPEED**order * array for order, array in enumerate(fast))
    wrench = random_wrenches(robot, SAMPLES, case[0])
    motion = Motion(np.arange(SAMPLES) * 1.0, q, dq, ddq, d3q, d4q, {}, wrench=wrench)
    available = [each for each in parameters(robot) if each.part != "actuator"]
    rng = np.random.default_rng(case[0])
    parts = ("mount", "dh", "link", "tools", "base", "gravity")
    chosen = [
        each for part in parts for each in drawn(rng, [one for one in available if one.part == part], 3)
    ]
    peak = np.abs(torques(robot, motion)).max(axis=(0, 2))[:, None]
    compared = 0
    for places, of_joints in torque_slopes(robot, motion, chosen):
        for at, place in enumerate(places):
            name, value = str(chosen[place]), chosen[place].value
            size = max(abs(value), 0.1)
            expected = sum(
                weight * torques(robot.replace(name, value + 1e-3 * count * size), motion)
                for count, weight in WEIGHTS.items()
            ) / (1e-3 * size)
            compared += 1
            for joint, found in enumerate(of_joints):
                exact = np.zeros_like(expected[joint]) if found is None else found[at]
                # Differences over 1e-3 leave 1e-18, and their rounding 1e-13 of the torques.
                assert (np.abs(exact - expected[joint]) * size < 1e-9 * peak).all(), name
    assert compared == len(chosen)


def drawn(rng: np.random.Generator, items: Sequence[Parameter], count: int) -> list[Parameter]:
    return [items[place] for place in rng.permutation(len(items))[:count]]


def torques(robot: Robot, motion: Motion) -> np.ndarray:
    """(joints, orders, samples)."""
    found = link_torques(robot, motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q, motion.wrench)
    return np.stack([found.tau_e, found.dtau_e, found.ddtau_e]).transpose(2, 0, 1)
