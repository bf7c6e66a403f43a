"""Reversals of motors with dry friction in tolerance bands: against drawn speeds and drawn robots."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.marks import slow_but
from samples.shipped import shipped_robot, shipped_run

from vsacli import Robot, Trajectory, load_trajectory, sensitivity
from vsacli.studies.sensitivities.band import Reversals

FORWARD, BACKWARD = 1.2, 0.7
DRAWS = 400_000


def puma() -> Robot:
    return shipped_robot("puma_560")


def coarse(folder: Path, robot: Robot) -> Trajectory:
    """The motion of the arm at a tenth of its rate."""
    text = (REPOSITORY / "trajectories/puma_560.yaml").read_text(encoding="utf-8")
    (folder / "coarse.yaml").write_text(text.replace("rate: 1000", "rate: 100"))
    return load_trajectory(folder / "coarse.yaml", robot)


@pytest.mark.parametrize("speed", slow_but([-0.3, 0.0], [-2.0, -0.3, 0.0, 0.1, 1.5]))
@pytest.mark.parametrize("correlation", [-0.9, 0.0, 0.6])
def test_the_variance_is_that_of_drawn_speeds(speed: float, correlation: float) -> None:
    """Of so many draws a variance is known to 1/sqrt(200000), 0.2 %; five times that is allowed."""
    ratio = 2.0  # gear: friction on the joint's side is twice that on the shaft
    motor = {
        "inertia": 0.1,
        "gear_ratio": ratio,
        "side": "shaft",
        "friction": {"coulomb": [BACKWARD, FORWARD]},
    }
    robot = dataclasses.replace(puma(), joints=puma().joints[:1]).replace(
        "joints.waist.actuator.motor", motor
    )
    deviation, of_torque = 0.8, 1.3
    covariance = [[deviation**2, correlation * deviation * of_torque]]
    covariance.append([covariance[0][1], of_torque**2])
    random = np.random.default_rng(0)
    v, tau = random.multivariate_normal([speed, 0.0], covariance, DRAWS).T
    drawn = np.var(tau + ratio * np.where(v > 0, FORWARD, -BACKWARD))
    shape = np.ones((1, 1, 2))
    added = Reversals(robot.actuators).variance(speed * shape, deviation * shape, covariance[0][1] * shape)
    assert of_torque**2 + added[0, 0] == pytest.approx([drawn] * 2, rel=0.01)


def test_smooth_friction_and_exact_speeds_add_nothing() -> None:
    robot = puma()
    smooth = robot.replace("joints.*.actuator.motor.friction.width", 0.01)
    speed = np.zeros((1, len(robot.joints), 2))
    assert not Reversals(smooth.actuators).possible
    assert not Reversals(robot.actuators).variance(speed, speed, speed).any()


def test_a_band_says_where_reversals_matter() -> None:
    """At the reversal itself friction is as likely forward as backward: half of the jump, 6.36 N m."""
    robot, motion = shipped_run("puma_560", "puma_560")
    found = sensitivity(robot, motion, ["joints.*.actuator.*"], tolerances="2%")
    elbow = found.band["elbow"]
    assert elbow.reversals > 0.9
    jump = 53.7063 * (0.132 + 0.105)
    assert 0.9 * jump / 2 < elbow.torque < 1.1 * jump / 2
    table = str(found).split("\n\n")[1].splitlines()
    assert table[0].endswith("mostly by")
    assert next(line for line in table if line.startswith("elbow")).endswith("reversal")
    assert "elbow: dry friction jumps where a motor reverses" in str(found)
    assert "--monte-carlo" in str(found)
    assert not found.band["shoulder"].reverses


@pytest.mark.slow
def test_drawn_robots_have_the_same_deviations(tmp_path: Path) -> None:
    """Of 200 draws a deviation is known to 5 %; three times that is allowed."""
    robot = puma()
    found = sensitivity(robot, coarse(tmp_path, robot), tolerances="2%", runs=200)
    assert found.monte_carlo is not None
    for joint, band in found.band.items():
        assert found.monte_carlo.torque[joint] == pytest.approx(band.torque, rel=0.15), joint
    assert "--monte-carlo" not in str(found)
