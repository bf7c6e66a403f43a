"""Searches for the best stiffness, compared with CasADi and IPOPT on the same splines and instants."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from ipopt_peer import Program
from subjects import ROBOTS, TRAJECTORIES
from timing import cpu_seconds, medians

from vsacli import load_robot, load_trajectory, optimize
from vsacli.base.arrays import evenly
from vsacli.robot.model import Robot
from vsacli.studies.search.acceptance import Acceptance, checked_range
from vsacli.studies.search.criteria import trapezoidal
from vsacli.studies.search.loads import joint_loads, periods, rests
from vsacli.studies.search.splines import SplineSpace
from vsacli.trajectory.trajectory import Trajectory

VSACLI, PEER = "`optimize`", "CasADi + IPOPT"
MARGIN = 0.01

PIECES, INSTANTS_PER_PIECE = 24, 8
"""Of the splines with which vsacli's searches end here, and of their bounds."""

SHAKE = """
format: vsacli-trajectory/1
name: shake
duration: 0.5
rate: 800
position: {type: sinusoids, frequency: 8, offset: [0, 0.3, -0.4], sine: [[0.1, 0.1, 0.1]]}
stiffness: {type: constant, value: 4000}
"""


class Optimized(NamedTuple):
    """A search for the best stiffness.

    Attributes:
        name: of robot and motion.
        joints: number of joints.
        seconds: by way.
        costs: root mean squares of the motor torques of each joint, by way.
    """

    name: str
    joints: int
    seconds: dict[str, float]
    costs: dict[str, list[float]]


def compare(repeats: int) -> Iterator[Optimized]:
    """Time both in turn: with all starts, refinements and runs here, one start and no run there."""
    for name, robot, trajectory in _subjects():
        programs = _programs(robot, trajectory)
        found = optimize(robot, trajectory, min_margin=MARGIN)
        ways = {
            VSACLI: cpu_seconds(lambda: optimize(robot, trajectory, min_margin=MARGIN)),
            PEER: cpu_seconds(lambda: [each.solved() for each in programs]),
        }
        costs = {
            VSACLI: [each.after for each in found.joints.values()],
            PEER: [each.solved() for each in programs],
        }
        yield Optimized(name, len(programs), medians(ways, repeats), costs)


def _subjects() -> Iterator[tuple[str, Robot, Trajectory]]:
    tendons = load_robot(ROBOTS / "tendon_1r.yaml")
    yield "tendons, rest to rest", tendons, load_trajectory(TRAJECTORIES / "tendon_1r.yaml", tendons)
    arm = load_robot(ROBOTS / "vsa_3r.yaml")
    yield "3R, rest to rest", arm, load_trajectory(TRAJECTORIES / "rest_to_rest.yaml", arm)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "shake.yaml")
        path.write_text(SHAKE)
        yield "3R, shaken", arm, load_trajectory(path, arm)


def _programs(robot: Robot, trajectory: Trajectory) -> list[Program]:
    """The problem of each joint over one period, between the same bounds."""
    rule, joints = Acceptance(robot, MARGIN), list(range(len(robot.joints)))
    programs = []
    for joint, load in zip(robot.joints, joint_loads(robot, trajectory, joints), strict=True):
        repeating = 0 if rests(trajectory) else periods(load)
        last = (len(load.time) - 1) // max(repeating, 1)
        period = load.at(evenly(last + 1, INSTANTS_PER_PIECE * PIECES + 1))
        space = (SplineSpace.periodic if repeating else SplineSpace.at_rest)(
            (float(period.time[0]), float(period.time[-1])), PIECES
        )
        admissible = checked_range(rule, joint, period)
        asked = np.clip(period.command.commanded["stiffness"], 1.05 * admissible.low, admissible.high)
        weights = trapezoidal(period.time) / (period.time[-1] - period.time[0])
        basis = space.basis(period.time, 3)
        start = space.fitted(period.time, asked)
        programs.append(Program(joint, period.command, admissible, basis, weights, start))
    return programs
