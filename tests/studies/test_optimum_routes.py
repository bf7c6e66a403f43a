"""One optimum, the same numbers by every route: search, run, `at()`, file; and limits between its samples."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.remedies import written

from vsacli import Robot, Trajectory, inverse_dynamics, load_robot, load_trajectory, optimize
from vsacli.studies.remedies import Remedy
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
        case "copper":
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
    written(Remedy(0.0, robot, trajectory), folder / "best.yaml")
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


@pytest.mark.slow
@pytest.mark.parametrize("criterion", ["peak", "torque", "energy"])
@pytest.mark.parametrize("rate", [8, 10, 12, 20])
def test_few_steps_have_the_optimum_of_many(tmp_path: Path, rate: int, criterion: str) -> None:
    robot = load_robot(TENDON)
    motion = load_trajectory(PULL, robot, {"rate": rate})
    found = optimize(robot, motion, criterion, margin=MARGIN, seed=2)
    [joint] = found.joints.values()
    # of the same at 1000 Hz; with one piece a step, 12 of them at 8 Hz, a spline follows its bounds to 1e-3
    expected = {"peak": 1.49876, "torque": 0.683972, "energy": 2.24903}[criterion]
    assert joint.after == pytest.approx(expected, rel=1e-3)
    assert joint.before == pytest.approx(reported(robot, motion, criterion), rel=1e-12)
    check_routes(robot, found, criterion, tmp_path, MARGIN)
