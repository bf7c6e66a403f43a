"""Random infeasible tasks: fixes hold between samples, and brute force finds nothing better."""

from __future__ import annotations

import itertools
import json
import math

import numpy as np
import pytest
from samples.infeasible_tasks import random_task
from samples.marks import slow_but

from vsacli import Flag, Motion, load_robot, load_trajectory, motor_torques

MARGIN = 0.01
FINER = 10
"""Parts of each step, at whose ends a fix is looked at."""

ROUNDING = 1e-9
"""Of numbers in a file that has 12 digits of them, in a margin."""

CLOSE = 1.01
"""Sizes are within 1 % of what brute force finds, or smaller."""

SUPERFLUOUS = 1.06
"""A combination that is not listed is less than 5 % smaller than a simpler fix that is; 1 % as above."""

FACTORS = (1.0, 1.1, 1.25, 1.5, 2.0, 3.0, 5.0, 8.0)
OFFSETS = (0.0, 0.02, -0.02, 0.05, -0.05, 0.1, -0.1, 0.2, -0.2, 0.4, 0.8, 2.0)
"""Relative to the root mean square of the stiffness, so that the size of a combination follows."""

FINE_OFFSETS = [sign * offset / 200 for offset in range(100) for sign in (1, -1)]

INFEASIBLE = (
    0, 1, 5, 6, 9, 13, 15, 16, 18, 20, 24, 25, 26, 29, 31, 32, 33, 34, 36, 37, 38, 39, 41, 45, 46, 47,
    48, 49, 50, 51, 54, 55, 57, 61, 62, 64, 65, 66, 68, 72, 74, 76, 77, 83, 84, 86, 89, 92, 93, 95,
    187,
)  # fmt: skip
"""Seeds whose task is infeasible, with every robot, kind of limit and outcome among them. At the last what
keeps a torque limit at the steps exceeds it between them."""

FURTHER = (200, 201, 202, 203, 204, 205, 206, 207, 208, 209, 210, 211, 212, 213, 214)
"""The first of the seeds on which nothing was tried before; some of their tasks are feasible."""

WRITTEN = 3
"""Of the fixes of a task the first, second or third is written, by its seed."""

QUICK = (0,)


def fine_joints(robot, motion):
    """Whether each joint has margin and limits all the time, from the corridor and the flags of a block."""
    block = motor_torques(robot, motion)
    room = np.minimum(block.stiffness - block.stiffness_min, block.stiffness_max - block.stiffness)
    narrow = room / block.stiffness < MARGIN - ROUNDING
    bad = narrow | ((block.flags & ~np.uint32(Flag.NEAR_SINGULAR)) != 0)
    return ~np.any(bad, axis=0)


def finely(trajectory):
    """The motion on a grid ten times finer than its steps."""
    time = trajectory.times.block(0, trajectory.samples)
    share = np.arange(FINER * (len(time) - 1) + 1) / FINER
    return trajectory.at(np.interp(share, np.arange(len(time)), time))


def changed_motion(motion, factor, offset):
    """The motion passed more slowly, each stiffness raised by a share of its root mean square."""
    slower = motion.mapped(motion.time, lambda array, order: array / factor**order)
    stiffness = slower.commanded["stiffness"]
    raised = stiffness + offset * np.sqrt(np.mean(stiffness**2, axis=0))
    return Motion.of(motion.time, {**slower.of_joints, "stiffness": raised}, slower.wrench)


def exchanged(robot):
    """The robot with the other branch wherever there is one."""
    branches = {index: joint.actuator.opposite_branch for index, joint in enumerate(robot.joints)}
    return robot.replace(
        {f"joints.{index}.actuator.branch": branch for index, branch in branches.items() if branch}
    )


def scanned(robots, motion, joints, factors=FACTORS, offsets=OFFSETS):
    """Size of the smallest combination on a grid, infinite if there is none; joints are independent."""
    best = math.inf
    for factor in factors:
        least = np.full(motion.q.shape[1], math.inf)
        for offset, robot in itertools.product(offsets, robots):
            fine = fine_joints(robot, changed_motion(motion, factor, offset))
            least[fine] = np.minimum(least[fine], abs(offset))
        best = min(best, math.hypot(factor - 1, *least[joints]))
    return best


def slower_by_whole_steps(robot, trajectory, motion, joints):
    """The smallest slow-down alone by whole steps, up to half as long again; infinite if none does."""
    steps = trajectory.samples - 1
    for number in range(steps + 1, steps + steps // 2):
        if fine_joints(robot, changed_motion(motion, number / steps, 0.0))[joints].all():
            return number / steps - 1
    return math.inf


def check_alone(found, robot, trajectory, motion, joints):
    """Slow-down and constants by themselves are within 1 % of brute force, or smaller."""
    constants = scanned([robot], motion, joints, factors=(1.0,), offsets=FINE_OFFSETS)
    if math.isfinite(constants):
        assert found["stiffness_offset"]["possible"]
    sizes = [
        each["size"] for each in found["fixes"] if set(each) == {"size", "motors", "stiffness_offset", "text"}
    ]
    # whole steps of the grid, of which the search has finer ones
    assert all(size <= CLOSE * constants for size in sizes[:1])
    slower = slower_by_whole_steps(robot, trajectory, motion, joints)
    if math.isfinite(slower):
        assert found["slow_down"]["factor"] - 1 <= CLOSE * slower


def check_written(paths, written, fix, joints):
    """The files of a fix keep margin and limits, between samples as well."""
    other = written.with_name(f"{written.stem}-robot.yaml")
    assert other.exists() == ("branch" in fix)
    robot = load_robot(other if other.exists() else paths[0])
    trajectory = load_trajectory(written, robot)
    assert trajectory.known_between
    assert fine_joints(robot, finely(trajectory))[joints].all(), fix["text"]


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", slow_but(QUICK, (*INFEASIBLE, *FURTHER)))
def test_every_fix_works_and_none_is_missed(tmp_path, vsacli, seed):
    paths = random_task(np.random.default_rng(seed), tmp_path)
    robot = load_robot(paths[0])
    trajectory = load_trajectory(paths[1], robot)
    motion = finely(trajectory)
    written, number = tmp_path / "fix.yaml", 1 + seed % WRITTEN
    done = vsacli("check-feasibility", *paths, "--write-fix", number, "-o", written, "--json")
    found = json.loads(done.out)["fixes"]
    failing = {robot.joint_names[index] for index in np.flatnonzero(~fine_joints(robot, motion))}
    assert failing <= {cause["joint"] for cause in found["causes"]}
    hopeless = {cause["joint"] for cause in found["causes"] if not cause["fixable"]}
    joints = [index for index, name in enumerate(robot.joint_names) if name not in hopeless]
    for index in set(range(len(robot.joints))) - set(joints):
        assert math.isinf(scanned([robot, exchanged(robot)], motion, [index]))
    fixes = found["fixes"]
    if not failing - hopeless:
        return
    smallest = min((each["size"] for each in fixes if "branch" not in each), default=math.inf)
    assert smallest <= SUPERFLUOUS * scanned([robot], motion, joints)
    assert fixes or math.isinf(scanned([robot, exchanged(robot)], motion, joints))
    if not trajectory.estimates:
        check_alone(found, robot, trajectory, motion, joints)
    assert written.exists() == (number <= len(fixes))
    if written.exists():
        check_written(paths, written, fixes[number - 1], joints)
