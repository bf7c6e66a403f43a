"""One optimum, the same numbers by every route: search, run, `at()`, file; and limits between its samples."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.fixes import pendulum, rest_to_rest, written

from vsacli import Robot, Trajectory, inverse_dynamics, load_robot, load_trajectory, optimize
from vsacli.studies.search import Fix
from vsacli.trajectory.times import RecordedTimes

MARGIN = 0.03

TENDON = REPOSITORY / "robots" / "tendon_1r.yaml"
PULL = REPOSITORY / "trajectories" / "tendon_1r.yaml"


def reported(robot: Robot, trajectory: Trajectory, criterion: str, index: int = 0) -> float:
    """The cost of a joint that rests at its ends, from the arrays and the report of a run."""
    run = inverse_dynamics(robot, trajectory)
    torques, energy = run.tau_motor[:, index], run.report.joints[index].energy
    match criterion:
        case "peak":
            return float(np.abs(torques).max())
        case "energy":
            return energy.spent + float(run.elastic_energy[0, index])
        case "copper_loss":
            assert energy.copper_loss is not None
            return energy.copper_loss
    mean = np.trapezoid((torques**2).mean(axis=-1), run.time) / trajectory.duration
    return float(np.sqrt(mean))


def finer(trajectory: Trajectory) -> Trajectory:
    """The same functions at ten times as many steps."""
    steps = trajectory.times.block(0, trajectory.samples)
    time = np.append((steps[:-1, None] + np.diff(steps)[:, None] * np.arange(10) / 10).ravel(), steps[-1])
    return trajectory.sampled(RecordedTimes(time))


def read_back(robot: Robot, trajectory: Trajectory, folder: Path) -> Trajectory:
    """What a file of it says."""
    written(Fix(0.0, robot, trajectory), folder / "best.yaml")
    return load_trajectory(folder / "best.yaml", robot)


def check_routes(robot: Robot, found: Any, criterion: str, folder: Path, margin: float) -> None:
    """Costs are those of runs of trajectory and file, which agree everywhere; limits hold between steps."""
    best = found.trajectory
    stored = read_back(robot, best, folder)
    assert stored.known_between
    time = np.linspace(best.start, best.start + best.duration, 997)
    for name, rows in best.at(time).variables().items():
        # a file has all digits; times from the first sample on differ by their rounding
        scale = np.nanmax(np.abs(rows), initial=0.0)
        np.testing.assert_allclose(stored.at(time).variables()[name], rows, atol=1e-9 * scale, err_msg=name)
    for index, joint in enumerate(found.joints.values()):
        # the same formulas over the same steps, but for the rounding of times
        assert joint.after == pytest.approx(reported(robot, best, criterion, index), rel=1e-12)
        assert joint.after == pytest.approx(reported(robot, stored, criterion, index), rel=1e-9)
    report = inverse_dynamics(robot, finer(best)).report
    assert report.verdict == "ok", report
    assert min(joint.margin for joint in report.joints) >= margin


@pytest.mark.cases(3)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "criterion"), [(8, "torque"), (8, "energy"), (10, "peak"), (12, "peak"), (20, "peak")]
)
def test_few_steps_have_the_optimum_of_many(tmp_path: Path, rate: int, criterion: str) -> None:
    robot = load_robot(TENDON)
    motion = load_trajectory(PULL, robot, {"rate": rate})
    found = optimize(robot, motion, criterion, min_margin=MARGIN, seed=2)
    [joint] = found.joints.values()
    # of the same at 1000 Hz; with one piece a step, 12 of them at 8 Hz, a spline follows its bounds to 1e-3
    expected = {"peak": 1.49876, "torque": 0.683972, "energy": 2.24903}[criterion]
    assert joint.after == pytest.approx(expected, rel=1e-3)
    assert joint.before == pytest.approx(reported(robot, motion, criterion), rel=1e-12)
    check_routes(robot, found, criterion, tmp_path, MARGIN)


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize(("criterion", "vary"), [("time", "timing"), ("peak", "timing"), ("torque", "both")])
def test_few_steps_have_another_timing(tmp_path: Path, criterion: str, vary: str) -> None:
    """At 10 Hz a pace has more detail than steps; the result has as many as describe it."""
    robot = load_robot(TENDON)
    found = optimize(robot, load_trajectory(PULL, robot, {"rate": 10}), criterion, vary, min_margin=MARGIN)
    check_routes(robot, found, criterion, tmp_path, MARGIN)
    if criterion == "time":
        # of the same at 1000 Hz, where the search ends within 1e-3 of its optimum
        assert found.timing.after == pytest.approx(0.6034, rel=2e-3)


@pytest.mark.slow
def test_costs_of_all_joints_are_those_of_runs(tmp_path: Path) -> None:
    """Heat and energy of an arm whose joints repeat themselves not at all, before and after."""
    numbers = {"gear_ratio": 1.0, "torque_constant": 2.0, "resistance": 3.0}
    robot = load_robot(REPOSITORY / "robots" / "vsa_3r.yaml").replace(
        {f"joints.*.actuator.motor.{name}": value for name, value in numbers.items()}
    )
    motion = load_trajectory(REPOSITORY / "trajectories" / "rest_to_rest.yaml", robot, {"rate": 100})
    for criterion in ("copper_loss", "energy"):
        folder = tmp_path / criterion
        folder.mkdir()
        found = optimize(robot, motion, criterion)
        check_routes(robot, found, criterion, folder, 0.01)
        for index, joint in enumerate(found.joints.values()):
            assert joint.before == pytest.approx(reported(robot, motion, criterion, index), rel=1e-12)


@pytest.mark.slow
def test_limits_hold_between_samples_of_random_motions() -> None:
    """Pendulums with motors of limited torque, from 8 to 300 steps a second; some motions are too much."""
    draw, kept = np.random.default_rng(5), 0
    for _ in range(6):
        start, end = draw.uniform(-1.5, 1.5, 2)
        rate, duration = float(np.exp(draw.uniform(*np.log([8, 300])))), draw.uniform(0.8, 2.0)
        motion = rest_to_rest(duration, (1000.0,), start=(start,), end=(end,), rate=rate)
        limit = draw.uniform(28.0, 50.0)
        robot = pendulum().replace({"joints.0.actuator.motor.max_torque": limit})
        criterion = draw.choice(["torque", "peak", "energy", "time"])
        vary = "timing" if criterion == "time" else "stiffness"
        found = optimize(robot, motion, criterion, vary, min_margin=MARGIN)
        if found.trajectory is None:
            assert "between" not in str(found)  # steps have nothing to do with what motors can do
            continue
        run = inverse_dynamics(robot, finer(found.trajectory))
        assert run.report.verdict == "ok", (rate, duration, limit, criterion, vary, run.report)
        assert run.report.joints[0].margin >= MARGIN
        assert np.abs(run.tau_motor).max() <= limit
        kept += 1
    assert kept >= 3


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize(("shorter", "slow_down"), [(0.62, 1.0), (0.3, 2.66)])
def test_what_has_no_stiffness_as_commanded_has_one_at_another_pace(shorter: float, slow_down: float) -> None:
    """Beyond the largest velocity at half the duration; at a third of it no pace keeps to that."""
    robot = load_robot(TENDON)
    motion = load_trajectory(PULL, robot, {"rate": 40}).stretched(shorter)
    assert not optimize(robot, motion, "torque").possible
    found = optimize(robot, motion, "torque", "both", min_margin=MARGIN)
    assert found.slow_down == pytest.approx(slow_down, rel=0.01)
    assert found.trajectory is not None
    assert found.pace is not None
    assert found.trajectory.duration == pytest.approx(found.slow_down * motion.duration)
    # the pace is that along the path as commanded
    assert found.pace.integrate(0, motion.duration) == pytest.approx(found.trajectory.duration)
    assert ("slowed down by a factor" in str(found)) == (slow_down > 1)
    assert inverse_dynamics(robot, finer(found.trajectory)).report.verdict == "ok"


@pytest.mark.slow
def test_a_stiffness_that_is_out_of_reach_at_any_pace_is_where_a_search_begins_elsewhere() -> None:
    """What the motors cost as commanded is not known then, and the fastest motion is the same."""
    robot = load_robot(TENDON)
    motion = load_trajectory(PULL, robot, {"rate": 40, "stiffness.start": 8, "stiffness.end": 38})
    found = optimize(robot, motion, "time", "both", min_margin=MARGIN)
    assert found.timing is not None
    assert np.isnan(found.timing.uniform)
    assert found.timing.after == pytest.approx(0.5872, rel=2e-3)
