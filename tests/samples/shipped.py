"""Robots and trajectories that come along, by name."""

from __future__ import annotations

from samples.command_line import REPOSITORY
from vsacli import Robot, Trajectory, load_robot, load_trajectory
from vsacli.files.examples import examples

EXAMPLES = examples()
"""All of them; each robot is read when it is needed first, and keeps what is computed of its springs."""


def shipped_robot(name: str) -> Robot:
    return load_robot(REPOSITORY / "robots" / f"{name}.yaml")


def shipped_run(robot: str, trajectory: str) -> tuple[Robot, Trajectory]:
    loaded = shipped_robot(robot)
    return loaded, load_trajectory(REPOSITORY / "trajectories" / f"{trajectory}.yaml", loaded)
