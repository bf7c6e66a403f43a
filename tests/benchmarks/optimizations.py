"""Searches for the best stiffness, compared with CasADi and IPOPT on the same splines and instants."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from ipopt_peer import Program
from subjects import ROBOTS, TRAJECTORIES
from timing import Seconds, cpu_seconds, medians

from vsacli import Robot, Trajectory, load_robot, load_trajectory, optimize
from vsacli.base.arrays import evenly
from vsacli.dynamics.losses import trapezoidal_weights
from vsacli.studies.search.acceptance import Acceptance, checked_range
from vsacli.studies.search.loads import joint_loads, periods, rests
from vsacli.studies.search.splines import SplineSpace

VSACLI, PEER = "`vsacli optimize`", "CasADi + IPOPT"
MARGIN = 0.01

PIECES, INSTANTS_PER_PIECE = 24, 8
"""Of the splines with which the searches of these motions end, and of the instants with bounds."""

SHAKE = """
format: vsacli-trajectory/1
name: shake
duration: 0.5
rate: 800
position: {type: sinusoids, frequency: 8, offset: [0, 0.3, -0.4], sine: [[0.1, 0.1, 0.1]]}
stiffness: {type: constant, value: 4000}
"""


class Optimized(NamedTuple):
    """Searches for the best stiffness of all joints of a robot.

    Attributes:
        name: of robot and motion.
        seconds: of processor time, by way.
        costs: root mean squares of the motor torques of each joint, N m, by way.
    """

    name: str
    seconds: Seconds
    costs: dict[str, list[float]]


def compare(repeats: int) -> list[Optimized]:
    """Time both in turn, on one motion after the other, in one thread as the command does."""
    line = [sys.executable, __file__, str(repeats)]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    printed = subprocess.run(line, check=True, capture_output=True, text=True, env=environment).stdout
    return [Optimized(*each) for each in json.loads(printed)]


def _compared(name: str, robot: Robot, trajectory: Trajectory, repeats: int) -> Optimized:
    programs = programs_of(robot, trajectory)

    def searched() -> list[float]:
        return [each.after for each in optimize(robot, trajectory, min_margin=MARGIN).joints.values()]

    def solved() -> list[float]:
        return [program.solved() for program in programs]

    seconds = medians({VSACLI: cpu_seconds(searched), PEER: cpu_seconds(solved)}, repeats)
    return Optimized(name, seconds, {VSACLI: searched(), PEER: solved()})


def _subjects() -> Iterator[tuple[str, Robot, Trajectory]]:
    tendons = load_robot(ROBOTS / "tendon_1r.yaml")
    yield "tendons, rest to rest", tendons, load_trajectory(TRAJECTORIES / "tendon_1r.yaml", tendons)
    arm = load_robot(ROBOTS / "vsa_3r.yaml")
    yield "3R, rest to rest", arm, load_trajectory(TRAJECTORIES / "rest_to_rest.yaml", arm)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "shake.yaml")
        path.write_text(SHAKE)
        yield "3R, shaken", arm, load_trajectory(path, arm)


def programs_of(robot: Robot, trajectory: Trajectory) -> list[Program]:
    """The problem of each joint over one period, within the bounds that vsacli keeps."""
    rule, joints = Acceptance(robot, MARGIN), list(range(len(robot.joints)))
    programs = []
    for joint, load in zip(robot.joints, joint_loads(robot, trajectory, joints), strict=True):
        repeating = 0 if rests(trajectory) else periods(load)
        last = (len(load.time) - 1) // max(repeating, 1)
        period = load.at(evenly(last + 1, INSTANTS_PER_PIECE * PIECES + 1))
        span = float(period.time[0]), float(period.time[-1])
        space = (SplineSpace.periodic if repeating else SplineSpace.at_rest)(span, PIECES)
        admissible = checked_range(rule, joint, period)
        asked = np.clip(period.command.commanded["stiffness"], 1.05 * admissible.low, admissible.high)
        weights = trapezoidal_weights(period.time) / (span[1] - span[0])
        start = space.fitted(period.time, asked)
        basis = space.basis(period.time, 3)
        programs.append(Program(joint, period.command, admissible, basis, weights, start))
    return programs


if __name__ == "__main__":
    json.dump([_compared(*subject, int(sys.argv[1])) for subject in _subjects()], sys.stdout)
