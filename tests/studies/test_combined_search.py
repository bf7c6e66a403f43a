"""Slow-down, stiffness and branch together."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from samples.fixes import BASE, accepted, changed, rest_to_rest
from samples.robots import vsa_3r

from vsacli import Limits, fixes, inverse_dynamics
from vsacli.studies.search.acceptance import Acceptance
from vsacli.studies.search.combined import (
    LARGEST_FACTOR,
    CombinedSearch,
    least_change,
    smallest_slow_down,
    unchanged,
)
from vsacli.studies.search.task import Task

FAST = rest_to_rest(0.3, rate=1000)


def search(robot=None, trajectory=FAST, **options):
    return CombinedSearch(Task(Acceptance(robot or vsa_3r(), 0.01), trajectory), **options)


@pytest.mark.slow
def test_smallest_combination_is_that_of_a_dense_scan():
    """At each factor the closed bound says what each joint needs."""
    found = search().smallest()
    sizes = []
    for factor in np.arange(1.0, 1.5, 0.005).tolist():
        slower = inverse_dynamics(vsa_3r(), FAST.stretched(factor))
        needed = np.max(slower.stiffness_min, axis=0) / 0.99 - 850.0
        sizes.append(math.hypot(factor - 1, *np.maximum(needed, 0.0) / 850.0))
    assert found.size == pytest.approx(min(sizes), rel=2e-3)  # flat at its minimum; strides of 0.5 %
    assert found.size < min(sizes[0], smallest_slow_down_of(FAST) - 1)


def smallest_slow_down_of(trajectory):
    return smallest_slow_down(Task(Acceptance(vsa_3r(), 0.01), trajectory)).factor


def test_slow_down_alone_is_the_fastest_combination_that_keeps_the_stiffness():
    found = search(form=unchanged).fastest()
    assert not found.constants
    assert found.size == found.factor - 1
    assert found.factor == pytest.approx(smallest_slow_down_of(FAST), rel=1e-12)


@pytest.mark.slow
def test_pointwise_change_is_smaller_than_a_constant():
    assert search(form=least_change).smallest().size < search().smallest().size


def test_fastest_is_as_fast_as_a_limit_of_the_motion_lets_it():
    robot = changed(BASE, limits=Limits(velocity=(-2.0, 2.0)))
    trajectory = rest_to_rest(1.0, 810.0, rate=1000.0)
    peak = math.pi / 2 * math.factorial(7) / math.factorial(3) ** 2 / 4**3  # of the degree 7, in 1 s
    found = search(robot, trajectory).fastest()
    assert 0 <= found.factor - peak / 2.0 <= 1.01e-3  # whole periods of 1 kHz
    assert found.constants.keys() == {1}


@pytest.mark.slow
def test_too_fast_and_slightly_too_soft_takes_both():
    robot = changed(BASE, limits=Limits(velocity=(-2.0, 2.0)))
    found = fixes(robot, rest_to_rest(1.0, 810.0, rate=1000.0))
    assert not any(
        each.possible for each in (found.slow_down, found.stiffness_offset, found.stiffness_profile)
    )
    (fix,) = found.fixes
    assert fix.sentence == (
        "slow down by a factor 1.719 (1 s -> 1.719 s), and raise the stiffness of shoulder by 19.55 N m/rad"
    )
    assert accepted(fix.robot, fix.trajectory)
    content = fix.as_json()
    assert content["slow_down"]["factor"] == 1.719
    assert content["stiffness_offset"]["offsets"] == {"base": 0.0, "shoulder": 19.55, "elbow": 0.0}
    assert "branch" not in content
    assert content["text"] == fix.sentence


@pytest.mark.slow
def test_simpler_fixes_come_with_less_than_the_combined_ones():
    found = fixes(vsa_3r(), FAST).fixes
    assert [fix.size for fix in found] == sorted(fix.size for fix in found)
    alone = [fix for fix in found if len(fix.kinds) == 1]
    assert {kind for fix in alone for kind in fix.kinds} == {"slow_down", "stiffness_offset"}
    for fix in found:
        assert accepted(fix.robot, fix.trajectory)


def test_springs_that_are_alike_leave_no_choice_of_branch():
    assert not search(branches=True).exchangeable


def unlike():
    """Soft springs, a little different, at the elbow."""
    springs = [{"type": "cubic", "k": 4, "k_c": 20}, {"type": "cubic", "k": 4.4, "k_c": 20}]
    robot = vsa_3r().replace("joints.elbow.actuator.spring", springs)
    robots = {each: robot.replace("joints.elbow.actuator.branch", each) for each in ("positive", "negative")}
    results = {branch: inverse_dynamics(each, rest_to_rest(4.0)) for branch, each in robots.items()}
    lowest = {branch: float(each.stiffness_min[:, 2].max()) for branch, each in results.items()}
    worse = max(lowest, key=lowest.get)
    trajectory = rest_to_rest(4.0, (850.0, 850.0, sum(lowest.values()) / 2))
    return robots[worse], trajectory


@pytest.mark.slow
def test_other_branch_comes_last_although_it_is_enough():
    robot, trajectory = unlike()
    *others, last = fixes(robot, trajectory, 1e-4).fixes
    assert all(fix.branch is None for fix in others)
    assert last.kinds == {"branch"}
    assert last.sentence == f"change the branch of elbow to {robot.joints[2].actuator.opposite_branch}"
    assert last.size == 0.0
    assert accepted(last.robot, last.trajectory, 1e-4)


def test_no_combination_is_slower_than_the_slowest_that_is_tried():
    """With so much damping the stiffness that is needed falls with the speed, beyond any factor."""
    base, *others = vsa_3r().joints
    robot = dataclasses.replace(vsa_3r(), joints=(dataclasses.replace(base, damping=1e20), *others))
    found = search(robot, rest_to_rest(4.0, rate=10), form=least_change).smallest()
    assert found is not None
    assert found.factor <= LARGEST_FACTOR


@pytest.mark.slow
def test_no_factor_has_a_smaller_combination():
    """Each factor of the grid by itself, up to the size of the smallest combination."""
    found = search().smallest()
    sizes = []
    for extra in range(round(300 * found.size) + 1):
        slower = FAST.stretched(1 + extra / 300)
        constants = Task(Acceptance(vsa_3r(), 0.01), slower).constants()
        sizes.append(math.hypot(extra / 300, constants.size))
    # the combination is judged at the samples alone, the constants here between them as well
    assert found.size == pytest.approx(min(sizes), rel=1e-4)


def test_paths_that_are_too_fast_have_no_combination():
    limited = search(changed(BASE, limits=Limits(velocity=(-2.0, 2.0))), rest_to_rest(1.0, 810.0))
    peak = math.pi / 2 * math.factorial(7) / math.factorial(3) ** 2 / 4**3  # of the degree 7, in 1 s
    assert limited.smallest().factor >= peak / 2.0 * (1 - 1e-6)  # samples may miss the very peak


def test_no_factor_makes_up_for_a_stiffness_limit():
    assert search().smallest() is not None
    assert search(changed(BASE, limits=Limits(stiffness=(100.0, 200.0)))).smallest() is None
