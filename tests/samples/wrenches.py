"""Wrenches, and a robot that holds a tool, for tests."""

from __future__ import annotations

import dataclasses

import numpy as np

from vsacli import Pose, Robot, Wrench

SCALES = (50.0, 250.0, 1250.0)
"""Half-widths of the components and their derivatives: as much as the links' own weight, and as fast."""


def random_wrench(samples: int, frame: str, seed: int) -> Wrench:
    """Unrelated random components and derivatives; no path, but any instant is possible."""
    rng = np.random.default_rng(seed)
    wrench, dwrench, ddwrench = (rng.uniform(-scale, scale, (samples, 6)) for scale in SCALES)
    return Wrench(wrench, dwrench, ddwrench, frame=frame)


def held(robot: Robot) -> Robot:
    """The robot on a tilted base, with a tool."""
    base = Pose(xyz=(0.3, -0.2, 0.7), rpy=(0.4, -1.1, 2.3))
    tool = Pose(xyz=(-0.1, 0.25, 0.15), rpy=(-0.7, 0.9, 1.9))
    return dataclasses.replace(robot, base=base, tool=tool)
