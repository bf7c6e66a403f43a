"""The robots and motions that are timed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from vsacli import Robot, load_robot
from vsacli.base.arrays import over_time

ROOT = Path(__file__).resolve().parents[2]
ROBOTS, TRAJECTORIES = ROOT / "robots", ROOT / "trajectories"
PAPER = ROBOTS / "vsa_3r.yaml", TRAJECTORIES / "rest_to_rest.yaml"
SEVEN_JOINTS = ROBOTS / "lwr_7r_vsa.yaml", TRAJECTORIES / "lwr_7r.yaml"


def seven_joints() -> Robot:
    """The arm with seven revolute joints on which everything is compared."""
    return load_robot(SEVEN_JOINTS[0])


def chain(joints: int) -> Robot:
    """The joints of that arm over and over again, in one long chain."""
    arm = seven_joints()
    repeated = tuple(
        replace(arm.joints[index % len(arm.joints)], name=f"joint{index + 1}") for index in range(joints)
    )
    return replace(arm, name=f"{joints} joints", joints=repeated)


def motion(joints: int, samples: int) -> list[np.ndarray]:
    """q and its four derivatives, each (samples, joints), laid out as a trajectory does: sines."""
    time = np.linspace(0, 3, samples)
    speed = 1 + np.arange(joints)[:, None] % 7 / 3
    return [over_time(0.5 * speed**order * np.sin(speed * time + order * np.pi / 2)) for order in range(5)]
