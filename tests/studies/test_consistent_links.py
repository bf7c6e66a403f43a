"""Links that are bodies: nearest to the file's, with what was found, or said to be none."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from samples.base_parameters import base_parameters
from samples.marks import slow
from samples.robots import random_link, random_robot
from samples.shipped import shipped_robot
from scipy.optimize import minimize

from vsacli import Inertia, Link, Robot
from vsacli.studies.identification.consistent_links import LinkEstimate, consistent_links
from vsacli.studies.identification.regressor import all_parameters


def relinked(robot: Robot, links: list[Link]) -> Robot:
    joints = (dataclasses.replace(each, link=link) for each, link in zip(robot.joints, links, strict=True))
    return dataclasses.replace(robot, joints=tuple(joints))


def told(robot: Robot, of: Robot, share: float = 1e-3) -> LinkEstimate:
    """The base parameters of another robot of the same chain, each known to a share."""
    base = base_parameters(robot)
    values = base.of(all_parameters(of))
    return LinkEstimate(base.shares, values, np.diag((share * np.abs(values) + 1e-6) ** 2))


def is_body(link: Link) -> bool:
    low, middle, high = link.inertia.principal_moments
    return bool(link.mass > 0 and low > 0 and high < low + middle)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("types", "seed"), [("R", 0), ("RP", 1), ("RRR", 0), slow("RPRR", 4), slow("RRR", 7)]
)
def test_links_have_what_was_found_of_other_bodies(types: str, seed: int) -> None:
    robot, random = random_robot(types, seed), np.random.default_rng(100 + seed)
    other = relinked(robot, [random_link(random) for _ in types])
    found = told(robot, other)
    bodies = consistent_links(robot, found)
    assert bodies.within
    assert all(map(is_body, bodies.links))
    again = found.shares @ all_parameters(relinked(robot, list(bodies.links)))
    assert again == pytest.approx(found.values, abs=3e-3 * np.abs(found.values).max())  # three errors


@pytest.mark.slow
def test_links_that_have_it_already_stay() -> None:
    robot = random_robot("RRP", seed=3)
    bodies = consistent_links(robot, told(robot, robot))
    assert all_parameters(relinked(robot, list(bodies.links))) == pytest.approx(
        all_parameters(robot), rel=1e-6
    )


def test_where_nothing_was_found_links_stay() -> None:
    robot = shipped_robot("puma_560")  # of whose links some are no bodies
    bodies = consistent_links(robot, LinkEstimate(np.zeros((0, 60)), np.zeros(0), np.zeros((0, 0))))
    assert bodies.within
    assert not bodies.links


def moments(parameters: np.ndarray) -> np.ndarray:
    """Second moments of mass, written out by their definition."""
    m, x, y, z, xx, yy, zz, xy, xz, yz = parameters
    return np.array(
        [
            [(yy + zz - xx) / 2, -xy, -xz, x],
            [-xy, (xx + zz - yy) / 2, -yz, y],
            [-xz, -yz, (xx + yy - zz) / 2, z],
            [x, y, z, m],
        ]
    )


def test_they_are_the_nearest_ones() -> None:
    """Against a search along what was not found: of a single joint, all but its base parameters."""
    robot = random_robot("R", seed=4)
    other = relinked(robot, [random_link(np.random.default_rng(5))])
    found = told(robot, other, share=1e-6)
    start, first = all_parameters(robot), all_parameters(other)
    unseen = np.linalg.svd(found.shares)[2][len(found.values) :]

    def entropy(x: np.ndarray) -> float:
        matrix, before = moments(x), moments(start)
        if np.linalg.eigvalsh(matrix)[0] <= 0:
            return 1e6
        ratio = np.linalg.solve(before, matrix)
        return float(np.trace(ratio) - np.log(np.linalg.det(ratio)) - 4)

    search = minimize(
        lambda s: entropy(first + s @ unseen), np.zeros(len(unseen)), tol=1e-12, options={"maxiter": 10000}
    )
    bodies = consistent_links(robot, found)
    nearest = all_parameters(relinked(robot, list(bodies.links)))
    assert entropy(nearest) == pytest.approx(search.fun, rel=1e-6)
    assert nearest == pytest.approx(first + search.x @ unseen, abs=1e-3)


def pendulum(inertia: float, error: float) -> tuple[Robot, LinkEstimate]:
    """One joint of whose link an inertia about the axis was found, and nothing else."""
    robot = shipped_robot("maccepa_1r")
    (shares,) = base_parameters(robot).shares
    return robot, LinkEstimate(shares[None], np.array([inertia]), np.array([[error**2]]))


def test_an_inertia_below_zero_within_its_error_leaves_bodies() -> None:
    bodies = consistent_links(*pendulum(-0.001, 0.001))
    assert bodies.within
    assert is_body(bodies.links[0])
    assert 1 < bodies.off[0] < 2


def test_an_inertia_below_zero_beyond_its_error_is_said_to_be_of_no_body() -> None:
    bodies = consistent_links(*pendulum(-0.01, 0.001))
    assert not bodies.within
    assert not bodies.links
    assert bodies.off[0] > 9


@pytest.mark.slow
def test_links_of_the_file_that_are_no_bodies_become_some() -> None:
    """A published arm has a link without mass, and others whose inertia breaks the triangle inequality."""
    robot = shipped_robot("puma_560")
    bodies = consistent_links(robot, told(robot, robot, share=0.05))
    assert all(map(is_body, bodies.links))
    flat = relinked(robot, [Link(mass=1, com=(0, 0, 0), inertia=Inertia(xx=1, yy=0, zz=0))] * 6)
    bodies = consistent_links(flat, told(robot, robot, share=0.05))
    assert all(map(is_body, bodies.links))
