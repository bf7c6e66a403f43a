"""Fixes of recorded motions: limits count as in a run, and the files keep the record."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from samples.fixes import pendulum, written
from samples.marks import slow

from vsacli import Limits, Robot, Trajectory, fixes, inverse_dynamics, load_trajectory
from vsacli.studies.search import Fix
from vsacli.studies.search.changed_motion import with_changed_stiffness
from vsacli.trajectory.times import ResampledTimes

VARIABLES = {"max_torque": "tau_motor", "max_velocity": "dtheta", "position": "q", "velocity": "dq"}
"""What limits bound."""

NOISE = 2e-4
"""Standard deviation of the samples, rad."""

DENSE = 4000
"""Hz: twenty samples in each interval of a recording."""

SEEDS, QUICK = 20, (2, 3)
STEP = 1 / 400
"""The grid of factors: a slower recording lasts a whole number of its own periods."""


def recorded_swing(seed: int, stiffness: float = 1500.0, noise: float = NOISE) -> Trajectory:
    """Two sines in white noise, 2 s at 200 Hz."""
    rng, time = np.random.default_rng(seed), np.linspace(0.0, 2.0, 401)
    rate = 2 * np.pi * rng.uniform(0.5, 0.9)
    swing = 0.4 * np.sin(rate * time + rng.uniform(0, 6)) + 0.15 * np.sin(2 * rate * time)
    q = swing + noise * rng.standard_normal(len(time))
    return Trajectory.from_samples(time + 5.0, q[:, None], np.full((len(time), 1), stiffness), name="swing")


def limited(robot: Robot, trajectory: Trajectory, limit: str, deviations: float) -> Robot:
    """With a limit that the motion exceeds by some standard deviations, and nowhere by more of them.

    Peaks between the samples count as well, so the limit is set where the motion is sampled densely.
    """
    dense = trajectory.sampled(ResampledTimes(*trajectory.times.span, DENSE))
    result, name = inverse_dynamics(robot, dense), VARIABLES[limit]
    bound = float(np.max(np.abs(getattr(result, name)) - deviations * getattr(result, f"{name}_std")))
    (joint,) = robot.joints
    if limit.startswith("max"):
        motors = tuple(dataclasses.replace(motor, **{limit: bound}) for motor in joint.actuator.motor)
        joint = dataclasses.replace(joint, actuator=dataclasses.replace(joint.actuator, motor=motors))
    else:
        joint = dataclasses.replace(joint, limits=Limits(**{limit: (-bound, bound)}))
    return dataclasses.replace(robot, joints=(joint,))


def check_file(fix: Fix, path: Path) -> None:
    """What is written is what was confirmed, with its uncertainty, and runs clean."""
    again = load_trajectory(written(fix, path)[0], fix.robot)
    before, after = (each.block(0, each.samples).variables() for each in (fix.trajectory, again))
    for name, array in before.items():
        np.testing.assert_array_equal(after[name], array)
    result = inverse_dynamics(fix.robot, again)
    assert result.report.verdict == "ok"
    assert result.tau_motor_std.max() > 0


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", [seed if seed in QUICK else slow(seed) for seed in range(SEEDS)])
def test_what_a_run_calls_ok_needs_no_fix_and_fixes_are_ok_in_a_run(tmp_path: Path, seed: int) -> None:
    trajectory, limit = recorded_swing(seed), list(VARIABLES)[seed % len(VARIABLES)]
    within = limited(pendulum(), trajectory, limit, 1.9)
    assert inverse_dynamics(within, trajectory).report.verdict == "ok"
    assert fixes(within, trajectory).slow_down is None
    beyond = limited(pendulum(), trajectory, limit, 2.5)
    assert inverse_dynamics(beyond, trajectory).report.verdict == "over_limit"
    found = fixes(beyond, trajectory)
    assert bool(found.fixes) == (limit != "position")
    for number, fix in enumerate(found.fixes):
        check_file(fix, tmp_path / f"fixed-{number}.yaml")
    for fix in found.fixes:
        if fix.kinds == {"slow_down"}:  # and not more than is needed
            faster = trajectory.stretched(fix.slow_down.factor - STEP)
            assert inverse_dynamics(beyond, faster).report.verdict == "over_limit"


@pytest.mark.slow
def test_a_slow_down_with_another_stiffness_allows_for_the_noise_at_its_own_speed() -> None:
    """Noise of velocities falls with the speed; limits count beyond two standard deviations of it.

    At two thirds of the speed they differ by more than a step of the grid from those at the full speed.
    """
    trajectory = recorded_swing(3, stiffness=790.0, noise=10 * NOISE)
    robot = limited(pendulum(), trajectory, "velocity", 250.0)
    fix = fixes(robot, trajectory).fixes[0]
    assert fix.kinds >= {"slow_down", "stiffness_offset"}
    assert inverse_dynamics(robot, fix.trajectory).report.verdict == "ok"
    faster = trajectory.stretched(fix.slow_down.factor - STEP)
    (joint,) = inverse_dynamics(robot, faster).report.joints
    assert joint.shows("over_limit")


@pytest.mark.slow
def test_a_limit_within_the_noise_keeps_nothing_else_from_being_fixed(tmp_path: Path) -> None:
    trajectory = recorded_swing(1)
    robot = limited(limited(pendulum(), trajectory, "position", 1.5), trajectory, "max_torque", 100.0)
    found = fixes(robot, trajectory).fixes
    assert {"slow_down"} in [fix.kinds for fix in found]
    for number, fix in enumerate(found):
        check_file(fix, tmp_path / f"fixed-{number}.yaml")


@pytest.mark.parametrize("reshaped", [False, True])
def test_records_with_steps_of_their_own_are_written_so_that_they_read_back(
    tmp_path: Path, reshaped: bool
) -> None:
    robot, time = pendulum(), 5.0 + np.linspace(0.0, 2.0, 201)
    q = 0.4 * np.sin(3 * time) + NOISE * np.random.default_rng(1).standard_normal(len(time))
    table = np.stack([time, q], axis=1)
    np.savetxt(tmp_path / "q.csv", table, delimiter=",", header="time,swing.q", comments="", fmt="%.17g")
    (tmp_path / "swing.yaml").write_text(
        "format: vsacli-trajectory/1\nname: swing\nrate: 150\n"
        f"position: {{type: csv, file: q.csv, noise: {NOISE}, fit: smooth}}\n"
        "stiffness: {type: constant, value: 1500}\n"
    )
    trajectory = load_trajectory(tmp_path / "swing.yaml", robot)
    rows = np.linspace(0.0, 1.0, 3)[:, None] * np.ones(trajectory.samples)
    fixed = with_changed_stiffness(trajectory, {0: rows}) if reshaped else trajectory
    path, _ = written(Fix(0.0, robot, fixed, factor=1.2), tmp_path / "fixed.yaml")
    again, fixed = load_trajectory(path, robot), fixed.stretched(1.2)
    assert bool(again.estimates) != reshaped
    # a record keeps its rate of 150 Hz, over 2.4 s; what is known at the steps has those it has
    assert again.samples == fixed.samples == (trajectory.samples if reshaped else 361)
    for name, array in fixed.block(0, fixed.samples).variables().items():
        np.testing.assert_allclose(again.block(0, again.samples).variables()[name], array, rtol=1e-12)
