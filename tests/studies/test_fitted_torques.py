"""Torques of the fitted robot: within the deviations that the report states, wherever it says ok."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples.excited import Excitation, Recorded, excited
from samples.random_arms import KINDS, misjudged, random_arm

from vsacli import Identification, Robot, identify

TORQUE_NOISE = 0.005
"""Noise of torques relative to the largest one of the arm."""


def motion_of(robot: Robot, rng: np.random.Generator) -> Excitation:
    count, settable = len(robot.joints), bool(robot.joints[0].actuator.commanded)
    return Excitation(
        position=[0] * count,
        reach=rng.uniform(0.3, 0.6, count).tolist(),
        stiffness=[1400] * count if settable else None,
        swing=[300] * count if settable else (),
        duration=20,
        rate=100,
    )


def largest_errors(robot: Robot, fitted: Robot, motion: Excitation, seed: int) -> np.ndarray:
    """Largest error of each motor's torque along a motion, by inverse dynamics of both robots."""
    runs: list[Recorded] = [excited(each, motion, seed) for each in (robot, fitted)]
    errors = np.abs(runs[1].tau_motor - runs[0].tau_motor).max(axis=0)
    return np.concatenate(
        [row[: joint.actuator.motor_count] for row, joint in zip(errors, robot.joints, strict=True)]
    )


def identification_of(seed: int, folder: Path) -> tuple[Identification, np.ndarray, np.ndarray]:
    """Errors of torques in stated deviations: along the recording of a random arm, and in another motion."""
    rng = np.random.default_rng(seed)
    robot = random_arm(KINDS[seed % 3], 1 + seed // 3 % 3, rng)
    file, motion = misjudged(robot, rng), motion_of(robot, rng)
    exact = excited(robot, motion, seed)
    noise = TORQUE_NOISE * float(np.nanmax(np.abs(exact.tau_motor)))
    found = identify(file, exact.noisy(seed, noise).write(folder / f"{seed}.csv", robot))
    along, elsewhere = np.array([[each.deviation, each.elsewhere] for each in found.deviations]).T
    return (
        found,
        largest_errors(robot, found.fitted, motion, seed) / along,
        largest_errors(robot, found.fitted, motion, 1000 + seed) / elsewhere,
    )


@pytest.mark.parametrize("seed", [0, 5])
def test_torques_of_the_fitted_robot_are_within_their_deviations(seed: int, tmp_path: Path) -> None:
    """A rigid and an antagonistic arm; statistics of many arms are below."""
    found, along, elsewhere = identification_of(seed, tmp_path)
    assert found.verdict == "ok"
    assert np.all(along < 4)
    assert np.all(elsewhere < 4)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_torques_of_a_hundred_fitted_arms_are_within_their_deviations(tmp_path: Path) -> None:
    """Rigid, elastic and antagonistic arms of one to three joints, each parameter off by up to half.

    The largest error of a motion is compared with the largest standard deviation. Few cosines determine the
    covariances, so that errors are distributed like Student's t: 92 % are within two, 98 % within three, and
    the worst of 250 motors is at 5.1.
    """
    runs = [identification_of(seed, tmp_path) for seed in range(100)]
    determined = [run for run in runs if run[0].verdict == "ok"]
    assert len(determined) > 80
    along, elsewhere = (np.concatenate([run[place] for run in determined]) for place in (1, 2))
    for errors in (along, elsewhere):
        assert np.mean(errors < 3) > 0.95
        assert np.max(errors) < 8
