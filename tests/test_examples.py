"""The robots and trajectories that are shipped: each robot runs with each trajectory made for it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from cli_samples import REPOSITORY

from vsacli import inverse_dynamics, load_robot, load_trajectory

ROBOTS = sorted((REPOSITORY / "robots").glob("*.yaml"))
RUNS = [
    (REPOSITORY / named, trajectory)
    for trajectory in sorted((REPOSITORY / "trajectories").glob("*.yaml"))
    for named in re.findall(r"robots/\w+\.yaml", trajectory.read_text(encoding="utf-8").partition(":")[0])
]
"""A trajectory begins with a comment that names its robots, "For robots/a.yaml and robots/b.yaml:"."""


def test_every_robot_has_a_trajectory():
    assert {robot for robot, _ in RUNS} == set(ROBOTS)


@pytest.mark.parametrize(
    ("robot", "trajectory"), RUNS, ids=[f"{robot.stem} {path.stem}" for robot, path in RUNS]
)
def test_example_can_be_done_with_a_margin(robot: Path, trajectory: Path):
    loaded = load_robot(robot)
    report = inverse_dynamics(loaded, load_trajectory(trajectory, loaded)).report
    assert report.verdict == "ok"
    # The paper's own runs keep 3.5 %; a shipped example is no edge case.
    assert all(joint.margin > 0.03 for joint in report.joints if joint.actuator == "antagonistic")


@pytest.mark.parametrize("path", ROBOTS, ids=[path.stem for path in ROBOTS])
def test_example_says_where_its_numbers_come_from(path: Path):
    text = path.read_text(encoding="utf-8")
    assert re.search(r"our own choice|is ours|are ours|Table I", text)
    assert load_robot(path).description
