"""Slow-down, stiffness and branch together, at whatever cost."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from samples.fixes import BASE, accepted, changed, rest_to_rest
from samples.robots import vsa_3r

from vsacli import fixes
from vsacli.analysis.run import Run
from vsacli.robot.joint import Limits
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError
from vsacli.studies.search.combined import CombinedSearch
from vsacli.studies.search.scans import LARGEST_FACTOR, smallest_slow_down
from vsacli.studies.search.task import RELATIVE_CHANGE, Task, least_change

FAST = rest_to_rest(0.3, rate=1000)


class Weighted:
    """The usual cost with other weights."""

    def __init__(self, factor, stiffness):
        self._weights = factor, stiffness

    def of_factor(self, factor):
        return self._weights[0] * RELATIVE_CHANGE.of_factor(factor)

    def of_stiffness(self, asked, change):
        return self._weights[1] * RELATIVE_CHANGE.of_stiffness(asked, change)


def search(robot=None, trajectory=FAST, **options):
    cost = options.pop("cost", RELATIVE_CHANGE)
    return CombinedSearch(Task(Acceptance(robot or vsa_3r(), 0.01), trajectory, cost), **options)


@pytest.mark.slow
def test_smallest_combination_is_that_of_a_dense_scan():
    """At each factor the closed bound says what each joint needs."""
    found = search().smallest()
    sizes = []
    for factor in np.arange(1.0, 1.5, 0.005).tolist():
        (block,) = Run(vsa_3r(), FAST.stretched(factor), block_samples=10_000)
        needed = np.max(block.stiffness_min, axis=0) / 0.99 - 850.0
        sizes.append(math.hypot(factor - 1, *np.maximum(needed, 0.0) / 850.0))
    assert found.size == pytest.approx(min(sizes), rel=2e-3)  # flat at its minimum; strides of 0.5 %
    assert found.size < min(sizes[0], smallest_slow_down_of(FAST) - 1)


def smallest_slow_down_of(trajectory):
    return smallest_slow_down(Acceptance(vsa_3r(), 0.01), trajectory)


def test_cost_decides_what_is_changed():
    patient = search(cost=Weighted(1e-6, 1.0)).smallest()
    assert not patient.changes
    assert patient.factor == pytest.approx(smallest_slow_down_of(FAST), abs=1.01e-4)
    hasty = search(cost=Weighted(1e3, 1.0)).smallest()
    assert hasty.factor == 1.0
    assert hasty.changes.keys() == {0, 1}


@pytest.mark.slow
def test_pointwise_change_is_smaller_than_a_constant():
    assert search(form=least_change).smallest().size < search().smallest().size


def test_fastest_is_as_fast_as_a_limit_of_the_motion_lets_it():
    robot = changed(BASE, limits=Limits(velocity=(-2.0, 2.0)))
    trajectory = rest_to_rest(1.0, 810.0, rate=1000.0)
    peak = math.pi / 2 * math.factorial(7) / math.factorial(3) ** 2 / 4**3  # of the degree 7, in 1 s
    found = search(robot, trajectory).fastest()
    assert 0 <= found.factor - peak / 2.0 <= 1.01e-3  # whole periods of 1 kHz
    assert found.changes.keys() == {1}


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
    lowest = {
        branch: max(
            float(block.stiffness_min[:, 2].max())
            for block in Run(robot.replace("joints.elbow.actuator.branch", branch), rest_to_rest(4.0))
        )
        for branch in ("positive", "negative")
    }
    worse = max(lowest, key=lowest.get)
    trajectory = rest_to_rest(4.0, (850.0, 850.0, sum(lowest.values()) / 2))
    return robot.replace("joints.elbow.actuator.branch", worse), trajectory


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
def test_discarded_factors_are_no_better():
    """Each factor of the scan by itself; bounds of the costs are below the costs."""
    searched, every = search(), search()
    found = searched.smallest()
    bounds = every._lower_bounds()
    sizes = {number: each.size for number in bounds if (each := every._at(number)) is not None}
    assert found.size <= min(sizes.values())
    assert all(bounds[number] <= size for number, size in sizes.items())
    assert len(searched._found) < len(sizes)


def test_a_cost_that_is_not_below_a_limit_is_not_searched_further():
    every = search()
    number = every._factors.first
    found = every._at(number)
    assert search()._at(number, below=0.99 * found.size) is None
    assert search()._at(number, below=1.01 * found.size).size == found.size


def test_paths_that_are_too_fast_are_those_that_each_factor_shows():
    limited = search(changed(BASE, limits=Limits(velocity=(-2.0, 2.0))), rest_to_rest(1.0, 810.0))
    limited._rule_out_paths()
    refused = set()
    for number in limited._scanned():
        try:
            limited._loads(limited._factors.factor(number))
        except ImpossibleError:
            refused.add(number)
    assert limited._impossible_paths == refused
    assert refused


def test_any_combination_is_enough_to_be_possible():
    assert search().possible()
    assert not search(changed(BASE, limits=Limits(stiffness=(100.0, 200.0)))).possible()
