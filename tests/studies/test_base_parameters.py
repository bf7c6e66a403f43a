"""The regressor of the links against other routes to the same torques, and what of it can be told."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from oracles import lagrange, pinocchio
from samples.base_parameters import base_parameters
from samples.marks import slow
from samples.robots import random_link, random_motion, random_robot
from samples.shipped import shipped_robot

from vsacli import Pose, Robot
from vsacli.studies.identification.regressor import (
    all_parameters,
    link_of,
    link_parameter_names,
    parameters_of,
    regressor,
)

TYPES = ("R", "P", "RRP", slow("PR"), slow("RPRR"), slow("RRRRRR"))


def relinked(robot: Robot, rng: np.random.Generator) -> Robot:
    """The same chain with other links."""
    joints = (dataclasses.replace(joint, link=random_link(rng)) for joint in robot.joints)
    return dataclasses.replace(robot, joints=tuple(joints))


@pytest.mark.cases(1)
@pytest.mark.parametrize("types", TYPES)
def test_the_regressor_is_lagranges(types: str) -> None:
    """Of as many sets of links as there are columns, so that each column is held to it."""
    robot, rng = random_robot(types, seed=len(types)), np.random.default_rng(1)
    motion = random_motion(robot, 5, seed=2)
    columns = regressor(robot, *motion[:3])
    for _ in range(10 * len(types)):
        other = relinked(robot, rng)
        damping = np.array([joint.damping for joint in robot.joints])[:, None] * motion[1].T
        expected = np.array(lagrange.chain_of(other, motion).torques(0)) - damping
        found = np.einsum("jps,p->js", columns, all_parameters(other))
        assert found == pytest.approx(expected, abs=1e-11 * np.abs(expected).max())  # rounding


@pytest.mark.slow
def test_base_and_tool_of_a_robot() -> None:
    """The base turns gravity; the tool has no mass."""
    robot = dataclasses.replace(
        random_robot("RRP", seed=5),
        base=Pose(xyz=(0.3, -0.1, 0.2), rpy=(0.4, -0.7, 1.1)),
        tool=Pose(xyz=(0.1, 0.2, 0.3), rpy=(0.1, 0.2, 0.3)),
    )
    motion = random_motion(robot, 5, seed=2)[:3]
    damping = np.array([joint.damping for joint in robot.joints]) * motion[1]
    expected = pinocchio.torques(robot, *motion) - damping
    found = np.einsum("jps,p->sj", regressor(robot, *motion), all_parameters(robot))
    assert found == pytest.approx(expected, abs=1e-11 * np.abs(expected).max())


def test_standard_parameters_of_a_link_and_back() -> None:
    link = random_link(np.random.default_rng(3))
    again = link_of(parameters_of(link))
    assert again.mass == link.mass
    assert again.com == pytest.approx(link.com, rel=1e-14)
    assert again.inertia.tensor == pytest.approx(link.inertia.tensor, abs=1e-14)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("planar_2r", 6),  # m x, m y and the inertia about each axis, by hand
        ("rp_2", 6),  # the slide's mass and first moments, and what the arm turns about its axis
        ("vsa_3r", 15),  # 7 n - 6 with the first axis along gravity (Gautier & Khalil, T-RA 6, 1990)
        slow("puma_560", 36),
        slow("ur5_6r", 36),
        slow("lwr_7r_vsa", 43),
    ],
)
def test_number_of_base_parameters(name: str, count: int) -> None:
    assert len(base_parameters(shipped_robot(name)).kept) == count


@pytest.mark.cases(1)
@pytest.mark.parametrize("types", TYPES)
def test_base_parameters_are_all_that_torques_tell(types: str) -> None:
    """As many as the rank of Pinocchio's regressor, and any change that leaves them leaves the torques."""
    robot = random_robot(types, seed=7)
    base = base_parameters(robot)
    motion = random_motion(robot, 30 * len(types), seed=8)
    dense = pinocchio.torque_regressor(robot, *motion[:3]).reshape(-1, 10 * len(types))
    size = np.linalg.norm(dense, axis=0)
    scaled = dense / np.where(size > 1e-12 * size.max(), size, np.inf)
    assert len(base.kept) == np.linalg.matrix_rank(scaled, tol=1e-8)

    unseen = np.random.default_rng(9).normal(size=10 * len(types))
    unseen -= np.linalg.lstsq(base.shares, base.of(unseen))[0]
    columns = regressor(robot, *motion[:3])
    assert np.abs(np.einsum("jps,p->js", columns, unseen)).max() < 1e-10 * np.abs(columns).max()


def test_each_base_parameter_says_of_what_it_is_the_sum() -> None:
    """By hand, for the paper's arm: the elbow's inertia about its own axis, and what the shoulder carries."""
    robot = shipped_robot("vsa_3r")
    base, of_links = base_parameters(robot), link_parameter_names(robot)
    words = [base.words(place, of_links) for place in range(len(base.kept))]
    assert "elbow.mx + 0.3 elbow.m" in words
    assert "shoulder.mx + 0.3 shoulder.m + 0.3 elbow.m" in words
    values = dict(zip(words, base.of(all_parameters(robot)), strict=True))
    assert values["elbow.mx + 0.3 elbow.m"] == pytest.approx(5.0894 * 0.15)
